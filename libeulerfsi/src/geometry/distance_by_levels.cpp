#include "geometry/distance_by_levels.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace efsi::geometry {

namespace {

constexpr int kLevels = 3;      // of halving
constexpr double kExact = 3.0;  // spacings of the grid: nodes closer to the mesh than that ask for their distance

// Distances at every stride-th node of a grid, and beyond its end where that is not one of them.
struct Level {
  int stride = 1;
  SignedDistance field;
};

// The distance at each node of `level` for which known(i, j, k, value) does not say it.
template <class Known>
void fill(const NearestTriangle& mesh, Level& level, const Known& known, const Parallel& parallel) {
  SignedDistance& field = level.field;
  parallel.for_each(static_cast<std::int64_t>(field.size[1]) * field.size[2], [&](std::int64_t row) {
    const int j = static_cast<int>(row % field.size[1]), k = static_cast<int>(row / field.size[1]);
    std::int32_t last = -1;  // what is nearest to a node is near to what is nearest to the one before
    for (int i = 0; i < field.size[0]; ++i) {
      float& value = field.values[field.index(i, j, k)];
      if (known(i, j, k, value)) continue;
      const NearestTriangle::Found found = mesh.find(field.node(i, j, k), last);
      last = found.leaf;
      value = static_cast<float>(found.distance);
    }
  });
}

// From every stride-th node to twice as many along each axis, of which there are `size`.
Level halve(const NearestTriangle& mesh, const Level& coarse, double spacing, const Vec3i& size,
            const Parallel& parallel) {
  const SignedDistance& from = coarse.field;
  Level fine{coarse.stride / 2, {size, 0.5 * from.spacing, from.origin, {}, -1}};
  fine.field.values.resize(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
  // What is that far from the mesh is not read closely, nor is any node of a finer level that takes part of its value
  // from there.
  const double least = (kExact + std::sqrt(3.0) * (fine.stride - 1)) * spacing;
  const auto known = [&](int i, int j, int k, float& value) {
    const int odd[3] = {i & 1, j & 1, k & 1};
    const double apart = std::sqrt(odd[0] + odd[1] + odd[2]) * fine.field.spacing;  // from the nodes around
    float sum = 0.0f, most = 0.0f;
    for (int c = 0; c < 8; ++c) {
      const float one =
          from.values[from.index((i + (c & odd[0])) / 2, (j + (c >> 1 & odd[1])) / 2, (k + (c >> 2 & odd[2])) / 2)];
      sum += one;
      most = std::max(most, one);
    }
    value = 0.125f * sum;
    return apart == 0.0 || most - apart > least;  // no distance changes faster than the place
  };
  fill(mesh, fine, known, parallel);
  return fine;
}

}  // namespace

void measure_by_levels(const NearestTriangle& mesh, SignedDistance& grid, const Parallel& parallel) {
  const auto nodes = [&](int stride) {
    Vec3i size;
    for (int axis = 0; axis < 3; ++axis) size[axis] = (grid.size[axis] - 2 + stride) / stride + 1;
    return size;
  };
  Level level{1 << kLevels, {}};
  level.field = {nodes(level.stride), grid.spacing * level.stride, grid.origin, {}, -1};
  const Vec3i& first = level.field.size;
  level.field.values.resize(static_cast<std::size_t>(first[0]) * first[1] * first[2]);
  fill(
      mesh, level, [](int, int, int, float&) { return false; }, parallel);
  while (level.stride > 1) level = halve(mesh, level, grid.spacing, nodes(level.stride / 2), parallel);
  grid.values = std::move(level.field.values);
}

}  // namespace efsi::geometry
