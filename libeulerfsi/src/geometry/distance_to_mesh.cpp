// Purpose: the distance from every node of a grid to a triangle mesh, without a sign.
#include "geometry/distance_to_mesh.hpp"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace efsi::geometry {

namespace {

// The mesh as tools::meshToVolume reads it, in index space of the grid.
class IndexSpaceMesh {
 public:
  IndexSpaceMesh(const TriangleMesh& mesh, const SignedDistance& grid) : triangles_(mesh.triangles) {
    points_.reserve(mesh.points.size());
    for (const Vec3d& X : mesh.points) {
      const Vec3d x = (X - grid.origin) / grid.spacing;
      points_.emplace_back(x.x(), x.y(), x.z());
    }
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const openvdb::Vec3d middle = (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3.0;
      double reach = 0.0;
      for (std::size_t at = 0; at < 3; ++at) reach = std::max(reach, (corner(t, at) - middle).length());
      openvdb::Vec3d normal = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
      // The ball alone for a needle, whose normal is mostly rounding.
      if (normal.length() > 1e-6 * reach * reach)
        normal.normalize();
      else
        normal = openvdb::Vec3d(0.0);
      discs_.push_back({middle, normal, reach * (1.0 + 1e-9) + 1e-9});
    }
  }
  std::size_t polygonCount() const { return triangles_.size(); }
  std::size_t pointCount() const { return points_.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t triangle, std::size_t at, openvdb::Vec3d& point) const {
    point = corner(triangle, at);
  }
  const openvdb::Vec3d& corner(std::size_t triangle, std::size_t at) const { return points_[triangles_[triangle][at]]; }

  double distance(std::int32_t triangle, const openvdb::Vec3d& X) const {
    openvdb::Vec3d weights;
    const openvdb::Vec3d nearest = openvdb::math::closestPointOnTriangleToPoint(
        corner(triangle, 0), corner(triangle, 1), corner(triangle, 2), X, weights);
    return (X - nearest).length();
  }

  // Is the triangle, by the disc around it, farther than `least` from X?
  bool is_beyond(std::int32_t triangle, const openvdb::Vec3d& X, double least) const {
    const Disc& disc = discs_[triangle];
    const openvdb::Vec3d way = X - disc.middle;
    const double height = way.dot(disc.normal);
    const double rest = least * least * (1.0 + 1e-6) + 1e-6 - height * height;
    if (rest < 0.0) return true;
    const double reach = disc.radius + std::sqrt(rest);
    return way.lengthSqr() - height * height > reach * reach;
  }

 private:
  struct Disc {
    openvdb::Vec3d middle, normal;
    double radius;  // a little more than to the corners, so that rounding cannot drop a triangle
  };
  const std::vector<Triangle>& triangles_;
  std::vector<openvdb::Vec3d> points_;
  std::vector<Disc> discs_;
};

// OpenVDB's voxelization: the nearest triangle of every node within kBand spacings of the mesh, -1 elsewhere. Which of
// several nearest ones is found can depend on how OpenVDB's threads share the work, so there is one thread.
std::vector<std::int32_t> nearest_triangles_in_band(const IndexSpaceMesh& mesh, const Vec3i& size) {
  constexpr float kBand = 3.0f;
  std::vector<std::int32_t> nearest(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
  tbb::task_arena(1).execute([&] {
    openvdb::Int32Grid indices(-1);
    openvdb::util::NullInterrupter interrupter;
    openvdb::tools::meshToVolume<openvdb::FloatGrid>(interrupter, mesh, openvdb::math::Transform(), kBand, 0.0f,
                                                     openvdb::tools::UNSIGNED_DISTANCE_FIELD, &indices);
    const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(size[0] - 1, size[1] - 1, size[2] - 1));
    openvdb::tools::Dense<std::int32_t, openvdb::tools::LayoutXYZ> dense(box, nearest.data());
    openvdb::tools::copyToDense(indices, dense, /*serial=*/true);
  });
  return nearest;
}

// Nodes outside the band take over the nearest triangle of a neighbour, swept through the grid in a diagonal direction.
class Sweep {
 public:
  Sweep(const IndexSpaceMesh& mesh, const SignedDistance& grid, int direction, std::vector<std::int32_t>& nearest,
        std::vector<double>& distance)
      : mesh_(mesh), grid_(grid), direction_(direction), nearest_(nearest), distance_(distance) {
    for (int way = 1; way < 8; ++way) {
      std::array<int, 3> back = {0, 0, 0};
      for (int axis = 0; axis < 3; ++axis)
        if (way >> axis & 1) back[axis] = direction >> axis & 1 ? 1 : -1;
      constexpr double kLength[] = {0.0, 1.0, 1.0, 1.4142135624, 1.0, 1.4142135624, 1.4142135624, 1.7320508076};
      offset_[way] = back[0] + std::ptrdiff_t{grid.size[0]} * (back[1] + std::ptrdiff_t{grid.size[1]} * back[2]);
      apart_[way] = kLength[way];
    }
  }

  // A row of nodes reads itself and the three rows behind it: all rows with the same sum of steps at once.
  void run(const Parallel& parallel) {
    constexpr std::int64_t kWorthThreads = 8192;  // nodes
    const int rows = grid_.size[1], slabs = grid_.size[2];
    for (int wave = 0; wave < rows + slabs - 1; ++wave) {
      const int first = std::max(0, wave - slabs + 1), last = std::min(wave, rows - 1);
      const std::int64_t count = last - first + 1;
      const auto row = [&](std::int64_t n) {
        sweep_row(first + static_cast<int>(n), wave - first - static_cast<int>(n));
      };
      (count * grid_.size[0] < kWorthThreads ? Parallel() : parallel).for_each(count, row);
    }
  }

 private:
  int along(int axis, int step) const { return direction_ >> axis & 1 ? grid_.size[axis] - 1 - step : step; }

  void sweep_row(int row_step, int slab_step) {
    const int j = along(1, row_step), k = along(2, slab_step);
    for (int step = 0; step < grid_.size[0]; ++step) {
      const int i = along(0, step);
      const std::size_t at = grid_.index(i, j, k);
      const int exists = (step > 0) | (row_step > 0) << 1 | (slab_step > 0) << 2;
      std::array<std::int32_t, 8> tried;
      int count = 0;
      for (int way = 1; way < 8; ++way) {  // along the edges, face diagonals and diagonal of a cell
        if ((way & ~exists) != 0) continue;
        const std::size_t from = at + static_cast<std::size_t>(offset_[way]);
        const std::int32_t triangle = nearest_[from];
        if (triangle < 0 || triangle == nearest_[at] || distance_[from] - apart_[way] >= distance_[at]) continue;
        if (std::find(tried.begin(), tried.begin() + count, triangle) != tried.begin() + count) continue;
        tried[count++] = triangle;
        const openvdb::Vec3d X(i, j, k);
        if (mesh_.is_beyond(triangle, X, distance_[at])) continue;
        const double candidate = mesh_.distance(triangle, X);
        if (candidate >= distance_[at]) continue;
        distance_[at] = candidate;
        nearest_[at] = triangle;
      }
    }
  }

  const IndexSpaceMesh& mesh_;
  const SignedDistance& grid_;
  int direction_;
  std::vector<std::int32_t>& nearest_;
  std::vector<double>& distance_;
  std::array<std::ptrdiff_t, 8> offset_{};
  std::array<double, 8> apart_{};
};

}  // namespace

void distance_to_mesh(const TriangleMesh& triangles, SignedDistance& grid, const Parallel& parallel,
                      const Progress& progress) {
  const IndexSpaceMesh mesh(triangles, grid);
  progress.at(0.0);
  std::vector<std::int32_t> nearest = nearest_triangles_in_band(mesh, grid.size);
  std::vector<double> distance(nearest.size(), std::numeric_limits<double>::infinity());
  progress.at(0.4);
  parallel.for_each(grid.size[2], [&](std::int64_t k) {
    for (int j = 0; j < grid.size[1]; ++j) {
      for (int i = 0; i < grid.size[0]; ++i) {
        const std::size_t at = grid.index(i, j, static_cast<int>(k));
        if (nearest[at] >= 0) distance[at] = mesh.distance(nearest[at], openvdb::Vec3d(i, j, static_cast<double>(k)));
      }
    }
  });
  for (int direction = 0; direction < 8; ++direction) {
    progress.at(0.45 + 0.06 * direction);
    Sweep(mesh, grid, direction, nearest, distance).run(parallel);
  }
  grid.values.resize(distance.size());
  for (std::size_t at = 0; at < distance.size(); ++at)
    grid.values[at] = static_cast<float>(distance[at] * grid.spacing);
}

}  // namespace efsi::geometry
