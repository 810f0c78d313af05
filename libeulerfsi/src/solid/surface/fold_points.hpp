// Purpose: points of a solid's surface, about a cell apart, and which of them are near in space but far in the
// material: where it folds onto itself (docs/numerics/folds.md).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::solid {

struct SolidRest;
struct SolidState;

// A point of the surface at rest.
struct FoldPoint {
  std::int32_t triangle;
  float second, third;        // weights of the triangle's last two corners
  float place[3], normal[3];  // at rest [m]; out of the solid
  std::uint32_t bends;        // 1: so far from its corners that the map has to say where it is

  Vec3d at_rest() const { return {place[0], place[1], place[2]}; }
};

// One in each box of edge `spacing` per side that the surface shows there, at most. What lies within the solid has
// none.
std::vector<FoldPoint> make_fold_points(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                        double spacing);

// Where they are [m], and the normals of their triangles; those that have no area: 0.
struct FoldPlaces {
  std::vector<Vec3d> place;
  std::vector<Eigen::Vector3f> normal;
};
FoldPlaces place_fold_points(const Parallel& parallel, const SolidRest& rest, const SolidState& state);

// Two points, one < other.
struct NearPair {
  std::int32_t one, other;
  float distance, at_rest;  // now and at rest [m]
};
// Those less than `reach` apart whose normals point in opposite directions, within a right angle, and that were more
// than `nearer` times as far from each other at rest, in ascending order.
std::vector<NearPair> find_near_pairs(const Parallel& parallel, const std::vector<FoldPoint>& points,
                                      const FoldPlaces& places, double reach, double nearer);

}  // namespace efsi::solid
