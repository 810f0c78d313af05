// Purpose: meshes for the tests: generated ones with known volumes, and files of the shared folder where it exists.
#pragma once

#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "geometry/triangle_mesh.hpp"
#include "io/mesh_reader.hpp"

// Folder with meshes that the project does not need; tests that use it are skipped without it.
#ifndef EFSI_SHARED_DIR
#define EFSI_SHARED_DIR EFSI_SOURCE_DIR "/../shared"
#endif

namespace efsi::geometry::shapes {

// Both meshes as one.
inline TriangleMesh together(TriangleMesh a, const TriangleMesh& b) {
  const std::int32_t first = static_cast<std::int32_t>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return a;
}

inline TriangleMesh inside_out(TriangleMesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

// Box from `low` to `high`; open: without the face of highest z.
inline TriangleMesh box(const Vec3d& low, const Vec3d& high, bool open = false) {
  std::vector<Vec3d> points;
  for (int c = 0; c < 8; ++c)
    points.emplace_back(c & 1 ? high.x() : low.x(), c & 2 ? high.y() : low.y(), c & 4 ? high.z() : low.z());
  std::vector<std::int32_t> indices = {0, 2, 3, 1, 0, 1, 5, 4, 1, 3, 7, 5, 3, 2, 6, 7, 2, 0, 4, 6, 4, 5, 7, 6};
  if (open) indices.resize(20);
  const std::vector<std::int32_t> counts(indices.size() / 4, 4);
  return triangulate(points, counts, indices);
}

// Sphere of radius r: an octahedron whose triangles are cut `cuts` times along each edge.
inline TriangleMesh sphere(double r, int cuts, const Vec3d& centre = Vec3d::Zero()) {
  TriangleMesh mesh;
  std::map<std::array<int, 3>, std::int32_t> known;
  const auto point = [&](std::array<int, 3> key) {
    const auto [at, fresh] = known.try_emplace(key, static_cast<std::int32_t>(mesh.points.size()));
    if (fresh) mesh.points.push_back(centre + r * Vec3d(key[0], key[1], key[2]).normalized());
    return at->second;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const int sx = octant & 1 ? -1 : 1, sy = octant & 2 ? -1 : 1, sz = octant & 4 ? -1 : 1;
    const bool mirrored = sx * sy * sz < 0;
    const auto at = [&](int i, int j) { return point({sx * (cuts - i - j), sy * i, sz * j}); };
    const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
      mesh.triangles.push_back(mirrored ? Triangle{a, c, b} : Triangle{a, b, c});
    };
    for (int i = 0; i < cuts; ++i) {
      for (int j = 0; i + j < cuts; ++j) {
        add(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < cuts) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
    }
  }
  return mesh;
}

// The part of a sphere of radius 0.4 that is less than half of that above its centre.
inline TriangleMesh bowl(int cuts, const Vec3d& centre) {
  TriangleMesh mesh = sphere(0.4, cuts, centre);
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    return (mesh.points[t[0]] + mesh.points[t[1]] + mesh.points[t[2]]).z() / 3 - centre.z() > 0.2;
  });
  return mesh;
}

// Torus around the z axis: ring radius, tube radius.
inline TriangleMesh torus(double ring, double tube, int around, int across) {
  std::vector<Vec3d> points;
  std::vector<std::int32_t> indices;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
      const double radius = ring + tube * std::cos(v);
      points.emplace_back(radius * std::cos(u), radius * std::sin(u), tube * std::sin(v));
      const int next_i = (i + 1) % around, next_j = (j + 1) % across;
      for (const int corner : {i * across + j, next_i * across + j, next_i * across + next_j, i * across + next_j})
        indices.push_back(corner);
    }
  }
  return triangulate(points, std::vector<std::int32_t>(indices.size() / 4, 4), indices);
}

// The mesh of a file, or nothing where it is absent.
inline std::optional<TriangleMesh> file_mesh(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  const io::PolygonMesh file = io::read_mesh(path.string());
  std::vector<Vec3d> points;
  for (const auto& p : file.points) points.emplace_back(p[0], p[1], p[2]);
  return triangulate(points, file.face_vertex_counts, file.face_vertex_indices);
}

// A mesh of the shared folder.
inline std::optional<TriangleMesh> shared_mesh(const std::string& name) {
  return file_mesh(std::filesystem::path(EFSI_SHARED_DIR) / "meshes" / name);
}

// The bunny as Debian's package glmark2-data installs it.
inline std::optional<TriangleMesh> installed_bunny() { return file_mesh("/usr/share/glmark2/models/bunny.obj"); }

}  // namespace efsi::geometry::shapes
