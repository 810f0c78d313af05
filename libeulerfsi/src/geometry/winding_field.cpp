// Purpose: the winding number of a mesh at the nodes of a grid and at points between them, for all meshes fast.
#include "geometry/winding_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/mesh_topology.hpp"

namespace efsi::geometry {

namespace {

constexpr std::int32_t kUnknown = std::numeric_limits<std::int32_t>::min();
constexpr int kBlock = 8;  // nodes along a block whose numbers are taken together

// Rows are counted this far beside the nodes, in spacings: no row meets an edge or a corner of the mesh, which like to
// lie on round numbers. Nodes that this puts on the other side of the surface lie on it.
constexpr double kBesideY = 0.7548776662e-7, kBesideZ = 0.5698402910e-7;

TriangleMesh together(TriangleMesh mesh, const std::vector<Triangle>& more) {
  mesh.triangles.insert(mesh.triangles.end(), more.begin(), more.end());
  return mesh;
}

struct Point2 {
  double y, z;
  bool operator<(const Point2& o) const { return y != o.y ? y < o.y : z < o.z; }
};

// Does the edge p -> q pass the row on its left? The same answer for both directions of an edge, up to the sign.
bool passes_left(const Point2& p, const Point2& q, double y, double z) {
  const bool ordered = p < q;
  const Point2 &low = ordered ? p : q, &high = ordered ? q : p;
  return ((high.y - low.y) * (z - low.z) - (high.z - low.z) * (y - low.y) > 0.0) == ordered;
}

// Winding numbers of a closed mesh at the nodes: along every row the changes where triangles pass it, summed up.
std::vector<std::int32_t> count_along_rows(const TriangleMesh& closed, const SignedDistance& grid,
                                           const Parallel& parallel) {
  std::vector<std::int32_t> count(grid.values.size(), 0);
  std::vector<Vec3d> points;  // in index space
  points.reserve(closed.points.size());
  for (const Vec3d& X : closed.points) points.push_back((X - grid.origin) / grid.spacing);
  const auto first_row = [](double low, double beside) { return static_cast<int>(std::ceil(low - beside)); };
  const auto last_row = [](double high, double beside) { return static_cast<int>(std::floor(high - beside)); };
  parallel.for_ranges(grid.size[2], [&](std::int64_t begin, std::int64_t end) {
    for (const Triangle& t : closed.triangles) {
      const Vec3d &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
      const Vec3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c), normal = (b - a).cross(c - a);
      const int last_k = std::min(last_row(high.z(), kBesideZ), static_cast<int>(end) - 1);
      const int first_j = std::max(first_row(low.y(), kBesideY), 0);
      const int last_j = std::min(last_row(high.y(), kBesideY), grid.size[1] - 1);
      for (int k = std::max(first_row(low.z(), kBesideZ), static_cast<int>(begin)); k <= last_k; ++k) {
        for (int j = first_j; j <= last_j; ++j) {
          const double y = j + kBesideY, z = k + kBesideZ;
          const Point2 p = {a.y(), a.z()}, q = {b.y(), b.z()}, r = {c.y(), c.z()};
          const bool left = passes_left(p, q, y, z);
          if (left != passes_left(q, r, y, z) || left != passes_left(r, p, y, z) || normal.x() == 0.0) continue;
          const double x = a.x() - (normal.y() * (y - a.y()) + normal.z() * (z - a.z())) / normal.x();
          const int i = static_cast<int>(std::ceil(std::clamp(x, low.x(), high.x())));
          if (i < grid.size[0]) count[grid.index(std::max(i, 0), j, k)] += left ? -1 : 1;
        }
      }
    }
    for (int k = static_cast<int>(begin); k < end; ++k)
      for (int j = 0; j < grid.size[1]; ++j)
        for (int i = 1; i < grid.size[0]; ++i) count[grid.index(i, j, k)] += count[grid.index(i - 1, j, k)];
  });
  return count;
}

}  // namespace

WindingField::WindingField(const TriangleMesh& mesh, const TriangleTree& tree, const SignedDistance& distance,
                           const Parallel& parallel, const Progress& progress)
    : tree_(tree),
      distance_(distance),
      closing_(closing_triangles(mesh)),
      closed_tree_(closing_.empty() ? TriangleMesh{} : together(mesh, closing_)),
      closing_tree_({mesh.points, closing_}, 1) {
  progress.at(0.0);
  count_ = count_along_rows(together(mesh, closing_), distance, parallel);
  at_nodes_.assign(count_.begin(), count_.end());
  if (!balanced()) subtract_closing_at_nodes(parallel, progress.part(0.1, 1.0));
  // On the surface there is no side: the number of the mesh itself, about half-way between those of the sides.
  parallel.for_each(distance.size[2], [&](std::int64_t k) {
    for (int j = 0; j < distance.size[1]; ++j) {
      for (int i = 0; i < distance.size[0]; ++i) {
        const std::size_t at = distance.index(i, j, static_cast<int>(k));
        if (distance.values[at] < kOnSurface * distance.spacing)
          at_nodes_[at] = static_cast<float>(tree.winding_number(distance.node(i, j, static_cast<int>(k))));
      }
    }
  });
}

void WindingField::subtract_closing_at_nodes(const Parallel& parallel, const Progress& progress) {
  Vec3i blocks;
  for (int axis = 0; axis < 3; ++axis) blocks[axis] = (distance_.size[axis] + kBlock - 1) / kBlock;
  const double half = 0.5 * (kBlock - 1) * distance_.spacing;
  progress.for_each(parallel, static_cast<std::int64_t>(blocks[0]) * blocks[1] * blocks[2], [&](std::int64_t block) {
    const int i0 = static_cast<int>(block % blocks[0]) * kBlock;
    const int j0 = static_cast<int>(block / blocks[0] % blocks[1]) * kBlock;
    const int k0 = static_cast<int>(block / blocks[0] / blocks[1]) * kBlock;
    std::vector<std::size_t> nodes;
    std::vector<Vec3d> points;
    for (int k = k0; k < std::min(k0 + kBlock, distance_.size[2]); ++k) {
      for (int j = j0; j < std::min(j0 + kBlock, distance_.size[1]); ++j) {
        for (int i = i0; i < std::min(i0 + kBlock, distance_.size[0]); ++i) {
          nodes.push_back(distance_.index(i, j, k));
          points.push_back(distance_.node(i, j, k));
        }
      }
    }
    std::vector<double> winding;
    std::vector<bool> on_closing;
    const Vec3d centre = distance_.node(i0, j0, k0) + Vec3d::Constant(half);
    closing_tree_.winding_numbers(centre, half, points, winding, on_closing);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (on_closing[n]) {
        count_[nodes[n]] = kUnknown;
        at_nodes_[nodes[n]] = static_cast<float>(tree_.winding_number(points[n]));
      } else {
        at_nodes_[nodes[n]] = static_cast<float>(count_[nodes[n]] - winding[n]);
      }
    }
  });
}

// Of the closed mesh at X: from the nearest node whose number is known, along the segment from there.
double WindingField::closed_number(const Vec3d& X) const {
  const TriangleTree& closed = balanced() ? tree_ : closed_tree_;
  std::array<int, 3> cell;
  for (int axis = 0; axis < 3; ++axis)
    cell[axis] = std::clamp(static_cast<int>(std::floor((X[axis] - distance_.origin[axis]) / distance_.spacing)), 0,
                            distance_.size[axis] - 2);
  double nearest = std::numeric_limits<double>::infinity();
  std::size_t from = 0;
  Vec3d start = X;
  for (int c = 0; c < 8; ++c) {
    const int i = cell[0] + (c & 1), j = cell[1] + (c >> 1 & 1), k = cell[2] + (c >> 2 & 1);
    const std::size_t at = distance_.index(i, j, k);
    const Vec3d node = distance_.node(i, j, k);
    const double apart = (node - X).squaredNorm();
    if (apart >= nearest || count_[at] == kUnknown || distance_.values[at] < kOnSurface * distance_.spacing) continue;
    nearest = apart;
    from = at;
    start = node;
  }
  if (nearest == std::numeric_limits<double>::infinity()) return std::round(closed.winding_number(X));
  return count_[from] + closed.winding_change(start, X);
}

std::vector<float> WindingField::at(const std::vector<Vec3d>& points, const Parallel& parallel,
                                    const Progress& progress) const {
  // A closed mesh: each point by itself.
  std::vector<float> numbers(points.size());
  if (balanced()) {
    constexpr std::int64_t kBatch = 256;
    const auto n = static_cast<std::int64_t>(points.size());
    progress.for_each(parallel, (n + kBatch - 1) / kBatch, [&](std::int64_t batch) {
      for (std::int64_t i = batch * kBatch; i < std::min(n, (batch + 1) * kBatch); ++i)
        numbers[i] = static_cast<float>(closed_number(points[i]));
    });
    return numbers;
  }
  // Points of one cube together.
  const double edge = kBlock * distance_.spacing;
  struct Entry {
    std::array<std::int32_t, 3> cube;
    std::int32_t point;
    auto operator<=>(const Entry&) const = default;
  };
  std::vector<Entry> entries(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    entries[i].point = static_cast<std::int32_t>(i);
    for (int axis = 0; axis < 3; ++axis)
      entries[i].cube[axis] = static_cast<std::int32_t>(std::floor((points[i][axis] - distance_.origin[axis]) / edge));
  }
  std::sort(entries.begin(), entries.end());
  std::vector<std::size_t> first;
  for (std::size_t e = 0; e < entries.size(); ++e)
    if (e == 0 || entries[e].cube != entries[e - 1].cube) first.push_back(e);
  first.push_back(entries.size());
  // Of each cube: the closed mesh, minus its closing triangles.
  progress.for_each(parallel, static_cast<std::int64_t>(first.size()) - 1, [&](std::int64_t group) {
    std::vector<Vec3d> members;
    for (std::size_t e = first[group]; e < first[group + 1]; ++e) members.push_back(points[entries[e].point]);
    const auto& cube = entries[first[group]].cube;
    const Vec3d centre = distance_.origin + edge * Vec3d(cube[0] + 0.5, cube[1] + 0.5, cube[2] + 0.5);
    std::vector<double> winding;
    std::vector<bool> on_closing;
    closing_tree_.winding_numbers(centre, 0.5 * edge, members, winding, on_closing);
    for (std::size_t m = 0; m < members.size(); ++m)
      numbers[entries[first[group] + m].point] =
          static_cast<float>(on_closing[m] ? tree_.winding_number(members[m]) : closed_number(members[m]) - winding[m]);
  });
  return numbers;
}

}  // namespace efsi::geometry
