// Purpose: triangle meshes: from polygons, volume and its centre, area, extents, normals.
#include "geometry/triangle_mesh.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <string>

#include "base/error.hpp"

namespace efsi::geometry {

namespace {

using Vec2d = Eigen::Vector2d;

double cross(const Vec2d& a, const Vec2d& b, const Vec2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Twice the vector area of a polygon (Newell): the normal of its mean plane.
Vec3d newell_normal(const std::vector<Vec3d>& points, std::span<const std::int32_t> face) {
  Vec3d normal = Vec3d::Zero();
  const Vec3d& origin = points[face[0]];
  for (std::size_t i = 1; i + 1 < face.size(); ++i)
    normal += (points[face[i]] - origin).cross(points[face[i + 1]] - origin);
  return normal;
}

// Corner `at` of the remaining polygon can be cut off: it is convex and no other corner lies in its triangle.
bool is_ear(const std::vector<Vec2d>& corners, const std::vector<int>& ring, std::size_t at) {
  const std::size_t n = ring.size();
  const Vec2d &a = corners[ring[(at + n - 1) % n]], &b = corners[ring[at]], &c = corners[ring[(at + 1) % n]];
  if (!(cross(a, b, c) > 0.0)) return false;
  for (std::size_t i = 2; i + 1 < n; ++i) {
    const Vec2d& p = corners[ring[(at + i) % n]];
    if (p == a || p == b || p == c) continue;  // a bridge to an inner contour passes twice through its ends
    if (cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0) return false;
  }
  return true;
}

// Ear clipping in the mean plane. A polygon without an ear (self-crossing, degenerate) still gives size - 2 triangles
// with the same outline, so that the mesh stays as closed as it was.
void triangulate_face(const std::vector<Vec3d>& points, std::span<const std::int32_t> face,
                      std::vector<Triangle>& triangles) {
  if (face.size() == 3) {
    triangles.push_back({face[0], face[1], face[2]});
    return;
  }
  const Vec3d normal = newell_normal(points, face);
  int drop = 0;
  normal.cwiseAbs().maxCoeff(&drop);
  const int first = (drop + 1) % 3, second = (drop + 2) % 3;
  const double side = normal[drop] < 0.0 ? -1.0 : 1.0;
  std::vector<Vec2d> corners;
  std::vector<int> ring;
  for (const std::int32_t index : face) {
    const Vec3d p = points[index] - points[face[0]];
    ring.push_back(static_cast<int>(corners.size()));
    corners.emplace_back(p[first], side * p[second]);
  }
  std::size_t at = 1;  // a convex polygon becomes the fan around its first corner
  while (ring.size() > 3) {
    const std::size_t n = ring.size();
    std::size_t ear = at % n;
    for (std::size_t tried = 0; tried < n && !is_ear(corners, ring, ear); ++tried) ear = (ear + 1) % n;
    triangles.push_back({face[ring[(ear + n - 1) % n]], face[ring[ear]], face[ring[(ear + 1) % n]]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
    at = ear;
  }
  triangles.push_back({face[ring[0]], face[ring[1]], face[ring[2]]});
}

void check_points(const std::vector<Vec3d>& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].allFinite()) continue;
    const Vec3d& p = points[i];
    refuse_mesh("points[" + std::to_string(i) + "] = (" + std::to_string(p.x()) + ", " + std::to_string(p.y()) + ", " +
                std::to_string(p.z()) + "): must be finite");
  }
}

// Number of faces, after checking that the counts are valid and use up the indices exactly.
std::size_t check_counts(std::span<const std::int32_t> counts, std::size_t index_count) {
  if (counts.empty()) {
    if (index_count % 3 != 0)
      refuse_mesh("face_vertex_indices has " + std::to_string(index_count) +
                  " entries: triangles need a multiple of 3 (no face_vertex_counts are given)");
    return index_count / 3;
  }
  std::size_t sum = 0;
  for (std::size_t f = 0; f < counts.size(); ++f) {
    if (counts[f] < 3)
      refuse_mesh("face_vertex_counts[" + std::to_string(f) + "] = " + std::to_string(counts[f]) +
                  ": must be at least 3");
    sum += static_cast<std::size_t>(counts[f]);
  }
  if (sum != index_count)
    refuse_mesh("face_vertex_counts add up to " + std::to_string(sum) + ", but face_vertex_indices has " +
                std::to_string(index_count) + " entries");
  return counts.size();
}

}  // namespace

void refuse_mesh(const std::string& what) { throw Error(ErrorCode::kMesh, "mesh: " + what); }

TriangleMesh triangulate(std::vector<Vec3d> points, std::span<const std::int32_t> face_vertex_counts,
                         std::span<const std::int32_t> face_vertex_indices) {
  if (points.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    refuse_mesh("has " + std::to_string(points.size()) + " points: at most 2147483647");
  check_points(points);
  const std::size_t faces = check_counts(face_vertex_counts, face_vertex_indices.size());
  if (faces == 0) refuse_mesh("has no face");
  for (std::size_t i = 0; i < face_vertex_indices.size(); ++i) {
    const std::int32_t index = face_vertex_indices[i];
    if (index < 0 || static_cast<std::size_t>(index) >= points.size())
      refuse_mesh("face_vertex_indices[" + std::to_string(i) + "] = " + std::to_string(index) + ": must be in [0, " +
                  std::to_string(points.size()) + ")");
  }
  TriangleMesh mesh;
  mesh.points = std::move(points);
  mesh.triangles.reserve(face_vertex_indices.size() - 2 * faces);
  std::size_t begin = 0;
  for (std::size_t f = 0; f < faces; ++f) {
    const std::size_t corners = face_vertex_counts.empty() ? 3 : static_cast<std::size_t>(face_vertex_counts[f]);
    triangulate_face(mesh.points, face_vertex_indices.subspan(begin, corners), mesh.triangles);
    begin += corners;
  }
  return mesh;
}

Extents extents(const TriangleMesh& mesh) {
  const double infinity = std::numeric_limits<double>::infinity();
  Extents box{Vec3d::Constant(infinity), Vec3d::Constant(-infinity)};
  for (const Triangle& triangle : mesh.triangles) {
    for (const std::int32_t corner : triangle) {
      box.min = box.min.cwiseMin(mesh.points[corner]);
      box.max = box.max.cwiseMax(mesh.points[corner]);
    }
  }
  return box;
}

namespace {

// Of the corners of all triangles.
Vec3d mean_corner(std::span<const Vec3d> points, std::span<const Triangle> triangles) {
  Vec3d mean = Vec3d::Zero();
  for (const Triangle& t : triangles) mean += points[t[0]] + points[t[1]] + points[t[2]];
  return mean / (3.0 * static_cast<double>(triangles.size()));
}

// Of the tetrahedron between the origin and a triangle.
double cone_volume(const Vec3d& a, const Vec3d& b, const Vec3d& c) { return a.dot(b.cross(c)) / 6.0; }

}  // namespace

double signed_volume(std::span<const Vec3d> points, std::span<const Triangle> triangles) {
  if (triangles.empty()) return 0.0;
  const Vec3d mean = mean_corner(points, triangles);
  double volume = 0.0;
  for (const Triangle& t : triangles)
    volume += cone_volume(points[t[0]] - mean, points[t[1]] - mean, points[t[2]] - mean);
  return volume;
}

Vec3d center_of_volume(const TriangleMesh& mesh) {
  constexpr double kNoVolume = 1e-9;  // of the volumes between the triangles and their mean, whatever their signs
  if (mesh.triangles.empty()) return Vec3d::Zero();
  const Vec3d mean = mean_corner(mesh.points, mesh.triangles);
  double volume = 0.0, without_sign = 0.0;
  Vec3d moment = Vec3d::Zero();
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = mesh.points[t[0]] - mean, b = mesh.points[t[1]] - mean, c = mesh.points[t[2]] - mean;
    const double v = cone_volume(a, b, c);
    volume += v;
    without_sign += std::abs(v);
    moment += v * (a + b + c) / 4.0;
  }
  return std::abs(volume) > kNoVolume * without_sign ? Vec3d(mean + moment / volume) : mean;
}

double triangle_area(const TriangleMesh& mesh, const Triangle& t) { return 0.5 * newell_normal(mesh.points, t).norm(); }

double surface_area(const TriangleMesh& mesh) {
  double area = 0.0;
  for (const Triangle& t : mesh.triangles) area += triangle_area(mesh, t);
  return area;
}

std::vector<Vec3d> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3d> normals(mesh.points.size(), Vec3d::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Vec3d twice_area = newell_normal(mesh.points, t);
    for (const std::int32_t corner : t) normals[corner] += twice_area;
  }
  for (Vec3d& normal : normals) {
    const double length = normal.norm();
    normal = length > 0.0 ? Vec3d(normal / length) : Vec3d::Zero();
  }
  return normals;
}

}  // namespace efsi::geometry
