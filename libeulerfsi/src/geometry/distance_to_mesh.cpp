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
  }
  std::size_t polygonCount() const { return triangles_.size(); }
  std::size_t pointCount() const { return points_.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t triangle, std::size_t at, openvdb::Vec3d& point) const {
    point = corner(triangle, at);
  }
  const openvdb::Vec3d& corner(std::size_t triangle, std::size_t at) const { return points_[triangles_[triangle][at]]; }

  openvdb::Vec3d nearest_point(std::int32_t triangle, const openvdb::Vec3d& X) const {
    openvdb::Vec3d weights;
    return openvdb::math::closestPointOnTriangleToPoint(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2),
                                                        X, weights);
  }

 private:
  const std::vector<Triangle>& triangles_;
  std::vector<openvdb::Vec3d> points_;
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

// A point of the mesh that is near a node, and its triangle; -1: none is known yet.
struct Foot {
  float x, y, z;
  std::int32_t triangle;
};

// Nodes take over the foot of a neighbour where it is nearer than their own, swept through the grid in a diagonal
// direction.
class Sweep {
 public:
  Sweep(const IndexSpaceMesh& mesh, const SignedDistance& grid, int direction, std::vector<Foot>& feet,
        std::vector<float>& squared)
      : mesh_(mesh), grid_(grid), direction_(direction), feet_(feet), squared_(squared) {
    for (int way = 1; way < 8; ++way) {  // along the edges, face diagonals and diagonal of a cell
      std::array<std::ptrdiff_t, 3> back = {0, 0, 0};
      for (int axis = 0; axis < 3; ++axis)
        if (way >> axis & 1) back[axis] = direction >> axis & 1 ? 1 : -1;
      apart_[way] = static_cast<float>(back[0] * back[0] + back[1] * back[1] + back[2] * back[2]);
      offset_[way] = back[0] + grid.size[0] * (back[1] + grid.size[1] * back[2]);
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
      const int i = along(0, step), exists = (step > 0) | (row_step > 0) << 1 | (slab_step > 0) << 2;
      const std::size_t at = grid_.index(i, j, k);
      for (int way = 1; way < 8; ++way) {
        if ((way & ~exists) != 0) continue;
        const Foot& foot = feet_[at + static_cast<std::size_t>(offset_[way])];
        if (foot.triangle < 0) continue;
        const float x = foot.x - static_cast<float>(i), y = foot.y - static_cast<float>(j);
        const float z = foot.z - static_cast<float>(k), squared = x * x + y * y + z * z;
        // Close to the mesh the point of the neighbour's triangle counts. One that is nearest to the neighbour is at
        // most nearer by the way from there, as squares go.
        if (squared_[at] < kClose && foot.triangle != feet_[at].triangle) {
          if (squared - apart_[way] < squared_[at]) take_exact(at, openvdb::Vec3d(i, j, k), foot.triangle);
          continue;
        }
        if (squared >= squared_[at]) continue;
        squared_[at] = squared;
        feet_[at] = foot;
      }
    }
  }

  void take_exact(std::size_t at, const openvdb::Vec3d& X, std::int32_t triangle) {
    const openvdb::Vec3d foot = mesh_.nearest_point(triangle, X);
    const float squared = static_cast<float>((X - foot).lengthSqr());
    if (squared >= squared_[at]) return;
    squared_[at] = squared;
    feet_[at] = {static_cast<float>(foot.x()), static_cast<float>(foot.y()), static_cast<float>(foot.z()), triangle};
  }

  static constexpr float kClose = 16.0f;  // squared distance [spacings^2]

  const IndexSpaceMesh& mesh_;
  const SignedDistance& grid_;
  int direction_;
  std::vector<Foot>& feet_;
  std::vector<float>& squared_;
  std::array<std::ptrdiff_t, 8> offset_{};
  std::array<float, 8> apart_{};  // squared
};

}  // namespace

void distance_to_mesh(const TriangleMesh& triangles, SignedDistance& grid, const Parallel& parallel,
                      const Progress& progress) {
  const IndexSpaceMesh mesh(triangles, grid);
  progress.at(0.0);
  const std::vector<std::int32_t> nearest = nearest_triangles_in_band(mesh, grid.size);
  std::vector<Foot> feet(nearest.size());
  std::vector<float> squared(nearest.size(), std::numeric_limits<float>::infinity());
  const auto for_each_node = [&](const auto& visit) {
    parallel.for_each(grid.size[2], [&](std::int64_t k) {
      for (int j = 0; j < grid.size[1]; ++j)
        for (int i = 0; i < grid.size[0]; ++i)
          visit(grid.index(i, j, static_cast<int>(k)), openvdb::Vec3d(i, j, static_cast<double>(k)));
    });
  };
  progress.at(0.4);
  for_each_node([&](std::size_t at, const openvdb::Vec3d& X) {
    feet[at].triangle = nearest[at];
    if (nearest[at] < 0) return;
    const openvdb::Vec3d foot = mesh.nearest_point(nearest[at], X);
    feet[at] = {static_cast<float>(foot.x()), static_cast<float>(foot.y()), static_cast<float>(foot.z()), nearest[at]};
    squared[at] = static_cast<float>((X - foot).lengthSqr());
  });
  for (int direction = 0; direction < 8; ++direction) {
    progress.at(0.5 + 0.05 * direction);
    Sweep(mesh, grid, direction, feet, squared).run(parallel);
  }
  grid.values.resize(nearest.size());
  for_each_node([&](std::size_t at, const openvdb::Vec3d& X) {
    const openvdb::Vec3d foot = mesh.nearest_point(feet[at].triangle, X);
    grid.values[at] = static_cast<float>((X - foot).length() * grid.spacing);
  });
}

}  // namespace efsi::geometry
