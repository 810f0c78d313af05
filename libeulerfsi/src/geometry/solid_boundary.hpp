// Purpose: the solid that a mesh stands for, when the mesh is open, self-crossing or in several parts: the set of
// points with winding number above 1/2, and its boundary: the parts of the mesh that bound it and caps over the holes.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "geometry/winding_field.hpp"

namespace efsi::geometry {

inline constexpr double kInsideWinding = 0.5;  // a point is inside the solid above this winding number

struct SolidBoundary {
  TriangleMesh mesh;                     // boundary of the solid, not welded: `kept` triangles and pieces, then caps
  std::size_t kept = 0;                  // of the mesh that was given
  bool differs = false;                  // from the mesh that was given
  std::uint64_t inner_triangles = 0;     // of the mesh that was given and do not bound the solid, whole or in part
  std::uint64_t cap_triangles = 0;       // over holes
  std::vector<std::size_t> first_piece;  // of each triangle of the mesh that was given, and the end
  std::vector<std::int32_t> triangle_of_piece;  // in `mesh`; -1: the piece does not bound the solid

  // The triangle of `mesh` at the point X of a triangle of the mesh that was given; -1: the solid is not bounded there.
  std::int32_t triangle_at(const TriangleMesh& given, double spacing, std::int32_t triangle, const Vec3d& X) const;
};

// Boundary of the solid on the scale of the grid: triangles are cut to pieces of about one spacing and a piece stays
// where the winding number passes 1/2 across it; caps are the level set 1/2 in the tetrahedra of the grid, away from
// the surface, where the mesh is not balanced. trust_cells: keep a piece without a test where the nodes around it lie
// on both sides (right for a mesh in one part).
SolidBoundary solid_boundary(const TriangleMesh& mesh, const SignedDistance& distance, const WindingField& winding,
                             bool trust_cells, const Parallel& parallel = Parallel(),
                             const Progress& progress = Progress());

}  // namespace efsi::geometry
