// Purpose: the distance from every node of a grid to a triangle mesh, without a sign, and to another mesh that is made
// of parts of the first one and more.
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

constexpr float kBand = 3.0f;  // spacings

// Triangles are offered to all nodes up to this far from them along each axis [spacings].
constexpr double kReach = 1.5;

// A node closer to the mesh than that has been offered its nearest triangle, by OpenVDB too, which visits the nodes
// beside those within 0.87 spacings: nothing that is carried to it is nearer. [spacings^2]
constexpr float kSettled = 2.24f;

double squared_length(const Vec3d& x) { return x.x() * x.x() + x.y() * x.y() + x.z() * x.z(); }

// Nodes closer to the mesh than that take over triangles from others, nodes farther away points. [spacings^2]
constexpr float kClose = 16.0f;

openvdb::Vec3d to_vdb(const Vec3d& X) { return {X.x(), X.y(), X.z()}; }

TriangleMesh in_index_space(TriangleMesh mesh, const Vec3d& origin, double spacing) {
  for (Vec3d& X : mesh.points) X = (X - origin) / spacing;
  return mesh;
}

// A mesh in index space as tools::meshToVolume reads it.
class MeshForVdb {
 public:
  explicit MeshForVdb(const TriangleMesh& mesh) : mesh_(mesh) {}
  std::size_t polygonCount() const { return mesh_.triangles.size(); }
  std::size_t pointCount() const { return mesh_.points.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t triangle, std::size_t at, openvdb::Vec3d& point) const {
    point = to_vdb(mesh_.points[mesh_.triangles[triangle][at]]);
  }

 private:
  const TriangleMesh& mesh_;
};

// OpenVDB's voxelization: the nearest triangle of every node within kBand spacings of the mesh, -1 elsewhere. Which of
// several nearest ones is found can depend on how OpenVDB's threads share the work, so there is one thread.
std::vector<std::int32_t> nearest_triangles_in_band(const TriangleMesh& mesh, const Vec3i& size) {
  std::vector<std::int32_t> nearest(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
  tbb::task_arena(1).execute([&] {
    openvdb::Int32Grid indices(-1);
    openvdb::util::NullInterrupter interrupter;
    openvdb::tools::meshToVolume<openvdb::FloatGrid>(interrupter, MeshForVdb(mesh), openvdb::math::Transform(), kBand,
                                                     0.0f, openvdb::tools::UNSIGNED_DISTANCE_FIELD, &indices);
    const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(size[0] - 1, size[1] - 1, size[2] - 1));
    openvdb::tools::Dense<std::int32_t, openvdb::tools::LayoutXYZ> dense(box, nearest.data());
    openvdb::tools::copyToDense(indices, dense, /*serial=*/true);
  });
  return nearest;
}

}  // namespace

Vec3d DistanceToMesh::nearest_point(std::int32_t triangle, const Vec3d& node) const {
  const Triangle& t = mesh_.triangles[triangle];
  openvdb::Vec3d weights;
  const openvdb::Vec3d foot = openvdb::math::closestPointOnTriangleToPoint(
      to_vdb(mesh_.points[t[0]]), to_vdb(mesh_.points[t[1]]), to_vdb(mesh_.points[t[2]]), to_vdb(node), weights);
  return {foot.x(), foot.y(), foot.z()};
}

// The triangle becomes the node's where it is nearer than what the node has.
void DistanceToMesh::take(std::size_t at, const Vec3d& node, std::int32_t triangle) {
  const Vec3d foot = nearest_point(triangle, node);
  const float squared = static_cast<float>(squared_length(node - foot));
  if (squared >= squared_[at]) return;
  squared_[at] = squared;
  feet_[at] = {static_cast<float>(foot.x()), static_cast<float>(foot.y()), static_cast<float>(foot.z()), triangle};
}

template <class Visit>
void DistanceToMesh::for_each_node(const Parallel& parallel, const Visit& visit) const {
  parallel.for_each(size_[2], [&](std::int64_t k) {
    for (int j = 0; j < size_[1]; ++j)
      for (int i = 0; i < size_[0]; ++i) visit(index(i, j, static_cast<int>(k)), Vec3d(i, j, static_cast<double>(k)));
  });
}

DistanceToMesh::DistanceToMesh(const TriangleMesh& mesh, const SignedDistance& grid, const Parallel& parallel,
                               const Progress& progress)
    : mesh_(in_index_space(mesh, grid.origin, grid.spacing)),
      size_(grid.size),
      origin_(grid.origin),
      spacing_(grid.spacing) {
  progress.at(0.0);
  const std::vector<std::int32_t> nearest = nearest_triangles_in_band(mesh_, size_);
  progress.at(0.9);
  feet_.resize(nearest.size());
  squared_.assign(nearest.size(), std::numeric_limits<float>::infinity());
  for_each_node(parallel, [&](std::size_t at, const Vec3d& node) {
    feet_[at].triangle = -1;
    if (nearest[at] >= 0) take(at, node, nearest[at]);
  });
}

void DistanceToMesh::measure_near(SignedDistance& grid, const Parallel& parallel) const {
  grid.values.resize(feet_.size());
  parallel.for_each(static_cast<std::int64_t>(feet_.size()), [&](std::int64_t at) {
    grid.values[at] = static_cast<float>(std::min(kBand, std::sqrt(squared_[at])) * grid.spacing);
  });
}

void DistanceToMesh::replace_mesh(const TriangleMesh& mesh, std::size_t kept, const SamePart& same_part,
                                  const Parallel& parallel) {
  std::vector<char> open(feet_.size(), 0);  // what is nearest is not known any more
  for_each_node(parallel, [&](std::size_t at, const Vec3d& node) {
    Foot& foot = feet_[at];
    if (foot.triangle >= 0)
      foot.triangle = same_part(foot.triangle, origin_ + spacing_ * nearest_point(foot.triangle, node));
    if (foot.triangle >= 0) return;
    open[at] = 1;
    squared_[at] = std::numeric_limits<float>::infinity();
  });
  mesh_ = in_index_space(mesh, origin_, spacing_);
  find_runs(kept);
  offer(
      kReach, [&](std::size_t triangle, std::size_t at) { return triangle >= kept || open[at]; }, parallel);
}

// Triangles that follow each other lie together, as they were made. Runs of them have boxes of about one spacing and
// hold kept triangles or new ones only.
void DistanceToMesh::find_runs(std::size_t kept) {
  constexpr std::size_t kMost = 12;
  constexpr double kLongest = 1.5;
  runs_.clear();
  for (std::size_t n = 0; n < mesh_.triangles.size(); ++n) {
    const Triangle& t = mesh_.triangles[n];
    const Vec3d &a = mesh_.points[t[0]], &b = mesh_.points[t[1]], &c = mesh_.points[t[2]];
    const Extents box = {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
    if (!runs_.empty() && n != kept) {
      Run& run = runs_.back();
      const Extents both = {run.box.min.cwiseMin(box.min), run.box.max.cwiseMax(box.max)};
      if (n - run.begin < kMost && (both.max - both.min).maxCoeff() <= kLongest) {
        run.end = n + 1;
        run.box = both;
        continue;
      }
    }
    runs_.push_back({n, n + 1, box});
  }
}

// Offers the triangles of the runs to the nodes up to `reach` from them along each axis for which wants(triangle, node)
// holds.
template <class Wants>
void DistanceToMesh::offer(double reach, const Wants& wants, const Parallel& parallel) {
  parallel.for_ranges(size_[2], [&](std::int64_t begin, std::int64_t end) {
    for (const Run& run : runs_) {
      const Vec3d &low = run.box.min, &high = run.box.max;
      Vec3i first, last;
      for (int axis = 0; axis < 3; ++axis) {
        first[axis] = std::max(static_cast<int>(std::ceil(low[axis] - reach)), axis == 2 ? static_cast<int>(begin) : 0);
        last[axis] = std::min(static_cast<int>(std::floor(high[axis] + reach)),
                              (axis == 2 ? static_cast<int>(end) : size_[axis]) - 1);
      }
      const auto beside = [&](int axis, int at) { return std::max({low[axis] - at, at - high[axis], 0.0}); };
      for (int k = first[2]; k <= last[2]; ++k) {
        const double z = beside(2, k);
        for (int j = first[1]; j <= last[1]; ++j) {
          const double y = beside(1, j), yz = y * y + z * z;
          for (int i = first[0]; i <= last[0]; ++i) {
            const std::size_t at = index(i, j, k);
            const double x = beside(0, i);
            if (x * x + yz >= squared_[at] || !wants(run.begin, at)) continue;
            for (std::size_t t = run.begin; t < run.end; ++t) take(at, Vec3d(i, j, k), static_cast<std::int32_t>(t));
          }
        }
      }
    }
  });
}

// Nodes take over the foot of a neighbour where it is nearer than their own, swept through the grid in a diagonal
// direction.
class DistanceToMesh::Sweep {
 public:
  Sweep(DistanceToMesh& nodes, int direction)
      : nodes_(nodes), direction_(direction), close_(nodes.runs_.empty() ? kClose : 0.0f) {
    for (int way = 1; way < 8; ++way) {  // along the edges, face diagonals and diagonal of a cell
      for (int axis = 0; axis < 3; ++axis)
        if (way >> axis & 1) back_[way][axis] = direction >> axis & 1 ? 1.0f : -1.0f;
      const auto step = [&](int axis) { return static_cast<std::ptrdiff_t>(back_[way][axis]); };
      apart_[way] = static_cast<float>(step(0) * step(0) + step(1) * step(1) + step(2) * step(2));
      offset_[way] = step(0) + nodes.size_[0] * (step(1) + nodes.size_[1] * step(2));
    }
  }

  // A row of nodes reads itself and the three rows behind it. Tiles of rows with the same sum of steps run at once.
  void run(const Parallel& parallel) {
    const int across = tiles(1), up = tiles(2);
    for (int wave = 0; wave < across + up - 1; ++wave) {
      const int first = std::max(0, wave - up + 1), last = std::min(wave, across - 1);
      parallel.for_each(last - first + 1, [&](std::int64_t n) {
        const int tile = first + static_cast<int>(n);
        sweep_tile(tile * kTile, (wave - tile) * kTile);
      });
    }
  }

 private:
  static constexpr int kTile = 8;         // rows
  static constexpr float kSlack = 1e-3f;  // for rounding [spacings^2]

  int tiles(int axis) const { return (nodes_.size_[axis] + kTile - 1) / kTile; }
  int along(int axis, int step) const { return direction_ >> axis & 1 ? nodes_.size_[axis] - 1 - step : step; }

  void sweep_tile(int first_row, int first_slab) {
    for (int slab = first_slab; slab < std::min(first_slab + kTile, nodes_.size_[2]); ++slab)
      for (int row = first_row; row < std::min(first_row + kTile, nodes_.size_[1]); ++row) sweep_row(row, slab);
  }

  void sweep_row(int row_step, int slab_step) {
    const int j = along(1, row_step), k = along(2, slab_step);
    const int behind = (row_step > 0) << 1 | (slab_step > 0) << 2;
    for (int step = 0; step < nodes_.size_[0]; ++step) {
      const int i = along(0, step);
      const std::size_t at = nodes_.index(i, j, k);
      if (nodes_.squared_[at] >= kSettled) sweep_node(at, i, j, k, behind | (step > 0));
    }
  }

  void sweep_node(std::size_t at, int i, int j, int k, int exists) {
    float& own = nodes_.squared_[at];
    for (int way = 1; way < 8; ++way) {
      if ((way & ~exists) != 0) continue;
      const Foot& foot = nodes_.feet_[at + static_cast<std::size_t>(offset_[way])];
      if (foot.triangle < 0) continue;
      const float x = foot.x - static_cast<float>(i), y = foot.y - static_cast<float>(j);
      const float z = foot.z - static_cast<float>(k), squared = x * x + y * y + z * z;
      // Close to the mesh the point of the neighbour's triangle counts, unless triangles are offered afterwards.
      if (own < close_ && foot.triangle != nodes_.feet_[at].triangle) {
        if (squared - most_gain(way, x, y, z, squared) < own) nodes_.take(at, Vec3d(i, j, k), foot.triangle);
      } else if (squared < own) {
        own = squared;
        nodes_.feet_[at] = foot;
      }
    }
  }

  // By how much the square of the distance to a triangle is smaller than that to its point at (x, y, z) from here,
  // which is nearest to the neighbour: by the square of the displacement from there, or of its part at right angles to
  // the line from point to neighbour, when that line leads on to here.
  float most_gain(int way, float x, float y, float z, float squared) const {
    const auto& back = back_[way];
    const float towards = x * back[0] + y * back[1] + z * back[2], along = towards - apart_[way];
    if (along <= 0.0f) return apart_[way] + kSlack;
    return apart_[way] - along * along / (squared - 2.0f * towards + apart_[way] + kSlack) + kSlack;
  }

  DistanceToMesh& nodes_;
  int direction_;
  float close_;
  std::array<std::ptrdiff_t, 8> offset_{};
  std::array<std::array<float, 3>, 8> back_{};
  std::array<float, 8> apart_{};  // squared
};

void DistanceToMesh::measure(SignedDistance& grid, const Parallel& parallel, const Progress& progress) {
  for (int direction = 0; direction < 8; ++direction) {
    progress.at(0.11 * direction);
    Sweep(*this, direction).run(parallel);
  }
  progress.at(0.88);
  // Sweeps do not find all that are nearest, and what they miss depends on their directions: near the mesh the distance
  // is exact, and so the same on both sides of a mesh that is its own mirror image.
  if (runs_.empty()) find_runs(0);
  offer(
      kBand, [](std::size_t, std::size_t) { return true; }, parallel);
  progress.at(0.96);
  grid.values.resize(feet_.size());
  for_each_node(parallel, [&](std::size_t at, const Vec3d& node) {
    grid.values[at] =
        static_cast<float>(std::sqrt(squared_length(node - nearest_point(feet_[at].triangle, node))) * spacing_);
  });
}

}  // namespace efsi::geometry
