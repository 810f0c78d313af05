// Purpose: points of a solid's surface, about a cell apart, and which of them are near in space but far in the
// material: where it folds onto itself (docs/numerics/folds.md).
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// One in each box of edge `spacing` per side that the surface shows there, at most. What lies within the solid has
// none.
std::vector<FoldPoint> make_fold_points(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                        double spacing);

// Where they are now.
FoldPlaces place_fold_points(const Parallel& parallel, const SolidRest& rest, const SolidState& state);

// Those less than `reach` apart whose normals point in opposite directions, within a right angle, and that were more
// than `nearer` times as far from each other at rest, in ascending order.
std::vector<NearPair> find_near_pairs(const Parallel& parallel, const std::vector<FoldPoint>& points,
                                      const FoldPlaces& places, double reach, double nearer);

}  // namespace efsi::solid
