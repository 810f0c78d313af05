// Purpose: the solid that a mesh stands for, when the mesh is open, self-crossing or in several parts: the set of
// points with winding number above 1/2, and its boundary: the parts of the mesh that bound it and caps over the holes.
#pragma once

#include <vector>

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "geometry/triangle_tree.hpp"

namespace efsi::geometry {

inline constexpr double kInsideWinding = 0.5;  // a point is inside the solid above this winding number

// Winding number at each node of the grid of `distance` (its order), where `distance` holds the distance to the mesh
// (>= 0). balanced: the mesh has no boundary, so that the number changes at the surface only; then it is computed close
// to the surface and once in every region between.
std::vector<float> node_winding_numbers(const TriangleTree& tree, const SignedDistance& distance, bool balanced);

struct SolidBoundary {
  TriangleMesh mesh;                // boundary of the solid, not welded
  bool differs = false;             // from the mesh that was given
  std::uint64_t cap_triangles = 0;  // over holes
};

// Boundary of the solid on the scale of the grid: triangles are cut to pieces of about one spacing and a piece stays
// where the winding number passes 1/2 across it; caps are the level set 1/2 in the tetrahedra of the grid, away from
// the surface, where the mesh is not balanced. trust_cells: keep a piece without a test where the nodes around it lie
// on both sides (right for a mesh in one part).
SolidBoundary solid_boundary(const TriangleMesh& mesh, const TriangleTree& tree, const SignedDistance& distance,
                             const std::vector<float>& winding, bool balanced, bool trust_cells);

}  // namespace efsi::geometry
