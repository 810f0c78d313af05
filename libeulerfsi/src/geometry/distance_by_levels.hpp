// Purpose: the distance from the nodes of a grid to a triangle mesh, at every node only as well as what reads it asks:
// for meshes that move in every step. geometry/distance_to_mesh.hpp is the exact method.
#pragma once

#include "base/parallel.hpp"
#include "geometry/nearest_triangle.hpp"
#include "geometry/signed_distance.hpp"

namespace efsi::geometry {

// Fills grid.values with the distance [m], without a sign: exactly within three spacings of the mesh; farther away
// linearly between nodes two, four and eight spacings apart, whose distances are exact. The bits depend on mesh and
// grid alone.
void measure_by_levels(const NearestTriangle& mesh, SignedDistance& grid, const Parallel& parallel = Parallel());

}  // namespace efsi::geometry
