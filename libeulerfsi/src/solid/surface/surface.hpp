// Purpose: the embedded surface mesh, carried passively by the reference map; it keeps its topology.
// Paper: Sec. 4.6 ("the mesh is advected passively in the same way as Fan et al. 2013").
//   a vertex with rest position X lies where x - u(x) = X: predicted by the velocity, corrected by Newton's method
#pragma once

#include <Eigen/Geometry>

#include "base/parallel.hpp"
#include "grid/boundary.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Places the vertices by the map, from where they are: Newton's method. A vertex outside the data stays.
void place_surface(const Parallel& parallel, const SolidRest& rest, SolidState& state);
// Where a map says something: in the box and, as surfaces overlap walls, a cell deep in each wall. No limit at open and
// periodic faces and across a slab.
Eigen::AlignedBox3d map_reach(const Grid& global, const grid::Walls& walls);
// The same for what predict_surface says, with the new u. Vertices that the map does not hold within its reach travel
// with their neighbours (solid/surface/surface_mend.hpp).
void correct_surface(const Parallel& parallel, const Eigen::AlignedBox3d& reach, const SolidRest& rest,
                     double max_stretch, SolidState& state);
// Velocities at the surface vertices [m/s].
void sample_surface_velocity(const Parallel& parallel, const SolidState& state, std::vector<Vec3d>& velocity);

// Volume inside the embedded surface over that at rest; 0 if it encloses none.
double volume_ratio(const SolidRest& rest, const SolidState& state);
// What the step has lost of the volume that it was to end with.
void measure_leak(const SolidRest& rest, const SolidWork& work, SolidState& state);
// Edges of the surface's triangles, each once, that are longer than kFalseStretch times their length at rest times the
// solid's largest stretch: their ends do not travel with the material that lies between them.
std::uint64_t count_false_edges(const SolidRest& rest, const SolidState& state, double max_stretch);
// Whether the surface bounds the solid; a sheet or parts that overlap do not.
bool encloses(const SolidRest& rest);

// Whether no vertex has left the box through an open face.
bool is_whole(const Grid& global, const grid::Walls& walls, const SolidState& state);

}  // namespace efsi::solid
