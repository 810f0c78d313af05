// Purpose: triangle meshes: from polygons, volume, extents, normals, and what is known about one as a solid.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::geometry {

using Triangle = std::array<std::int32_t, 3>;

struct TriangleMesh {
  std::vector<Vec3d> points;        // [m]
  std::vector<Triangle> triangles;  // counter-clockwise seen from outside
};

// An error "mesh: what" (ErrorCode::kMesh).
[[noreturn]] void refuse_mesh(const std::string& what);

struct Extents {
  Vec3d min, max;  // [m]
};

// What was found in a mesh and what was done about it; the C++ face of EfsiMeshReport.
struct MeshReport {
  double surface_volume = 0.0;                                   // signed volume of the mesh as passed [m^3]
  double solid_volume = 0.0;                                     // volume of the closed solid [m^3]
  Vec3d extent_min = Vec3d::Zero(), extent_max = Vec3d::Zero();  // [m]
  std::uint64_t triangles = 0;
  std::uint64_t open_edges = 0;          // edges with one face
  std::uint64_t holes = 0;               // closed loops of open edges
  double largest_hole = 0.0;             // length of the longest such loop [m]
  std::uint64_t nonmanifold_edges = 0;   // edges with three faces and more
  bool closed = false;                   // no open edge
  bool repaired = false;                 // something was repaired
  double thinnest_feature = 0.0;         // estimate of the smallest thickness of the solid [m]
  double closing_radius = 0.0;           // offset used to close the mesh [m]; 0: none
  std::uint32_t pieces = 0;              // that no edge connects
  std::uint32_t separate_pieces = 0;     // of these, groups that do not touch each other
  std::uint32_t merged_points = 0;       // points of triangles that lay on another one
  std::uint32_t reversed_triangles = 0;  // that were inside out, alone or with their piece or the mesh
  std::uint32_t inner_triangles = 0;     // left out, whole or in part: they lie inside the solid
  std::string repairs;                   // what was repaired in words; "": nothing
};

// Triangles of a polygon mesh; concave polygons are cut by ear clipping in the plane of their mean normal.
//   points: [m], kept in number and order
//   face_vertex_counts: corners per face; empty: every face is a triangle
//   face_vertex_indices: corners of all faces, 0-based
// Throws Error(kMesh) naming the entry, its value and the limit: point that is not finite, count below 3, index out of
// range, counts that do not add up to the number of indices, no face at all.
TriangleMesh triangulate(std::vector<Vec3d> points, std::span<const std::int32_t> face_vertex_counts,
                         std::span<const std::int32_t> face_vertex_indices);

// Box around the points that triangles use [m]. The mesh must have a triangle.
Extents extents(const TriangleMesh& mesh);

// Signed volume [m^3], positive when triangles are counter-clockwise seen from outside. An open mesh is closed by cones
// from the mean of its corners, so that it turns and stretches with the mesh.
double signed_volume(std::span<const Vec3d> points, std::span<const Triangle> triangles);
inline double signed_volume(const TriangleMesh& mesh) { return signed_volume(mesh.points, mesh.triangles); }

// Wherever the mesh is, also where it is open; of a mesh that encloses nothing the mean of its corners.
Vec3d center_of_volume(const TriangleMesh& mesh);

double triangle_area(const TriangleMesh& mesh, const Triangle& t);  // [m^2]
double surface_area(const TriangleMesh& mesh);                      // [m^2]

// Unit normal of each point, the area-weighted mean over its triangles; zero for a point without area around it.
std::vector<Vec3d> vertex_normals(const TriangleMesh& mesh);

}  // namespace efsi::geometry
