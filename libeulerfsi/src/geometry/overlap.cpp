// Purpose: how deep and how much two solids lie in each other.
#include "geometry/overlap.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::geometry {

namespace {

constexpr int kParts = 4;  // of a cell's edge, in the search for the deepest point

Vec3d last_node(const SignedDistance& grid) { return grid.node(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1); }

}  // namespace

Overlap overlap(const SignedDistance& a, const SignedDistance& b, const Parallel& parallel) {
  const Vec3d low = a.origin.cwiseMax(b.origin), high = last_node(a).cwiseMin(last_node(b));
  if ((high.array() <= low.array()).any()) return {};
  // The field of the intersection: negative where both are; not more than the distance to its boundary inside.
  const auto both = [&](const Vec3d& X) { return std::max(a.sample(X), b.sample(X)); };
  SignedDistance field;
  field.spacing = std::min(a.spacing, b.spacing);
  field.origin = low;
  field.flat = a.flat == b.flat ? a.flat : -1;
  for (int axis = 0; axis < 3; ++axis)
    field.size[axis] = static_cast<int>(std::ceil((high[axis] - low[axis]) / field.spacing)) + 1;
  field.values.resize(static_cast<std::size_t>(field.size[0]) * field.size[1] * field.size[2]);
  parallel.for_each(field.size[2], [&](std::int64_t k) {
    for (int j = 0; j < field.size[1]; ++j)
      for (int i = 0; i < field.size[0]; ++i)
        field.values[field.index(i, j, static_cast<int>(k))] =
            static_cast<float>(both(field.node(i, j, static_cast<int>(k))));
  });
  // Distances change by no more than the displacement: only cells whose corners come close to the deepest node can hold
  // more.
  const double deepest = -*std::min_element(field.values.begin(), field.values.end());
  const double gain = 1.05 * std::sqrt(3.0) * 0.5 * field.spacing;
  if (deepest + gain <= 0.0) return {};
  const double depth = parallel.max(field.size[2], std::max(0.0, deepest), [&](std::int64_t k) {
    double best = 0.0;
    for (int j = 0; j < field.size[1]; ++j) {
      for (int i = 0; i < field.size[0]; ++i) {
        if (-field.values[field.index(i, j, static_cast<int>(k))] + gain <= deepest) continue;
        const Vec3d node = field.node(i, j, static_cast<int>(k));
        for (int z = -kParts / 2; z <= kParts / 2; ++z)
          for (int y = -kParts / 2; y <= kParts / 2; ++y)
            for (int x = -kParts / 2; x <= kParts / 2; ++x)
              best = std::max(best, -both(node + field.spacing / kParts * Vec3d(x, y, z)));
      }
    }
    return best;
  });
  return {2.0 * depth, field.volume()};
}

}  // namespace efsi::geometry
