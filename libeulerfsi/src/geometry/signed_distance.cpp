// Purpose: a signed distance field on the nodes of a dense regular grid in material space.
#include "geometry/signed_distance.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/kuhn.hpp"

namespace efsi::geometry {

namespace {

// Part of a tetrahedron's volume where the linear function with values v at its corners is negative.
double negative_fraction(std::array<double, 4> v) {
  std::sort(v.begin(), v.end());
  if (v[0] >= 0.0) return 0.0;
  if (v[3] <= 0.0) return 1.0;
  if (v[1] >= 0.0) return v[0] * v[0] * v[0] / ((v[0] - v[1]) * (v[0] - v[2]) * (v[0] - v[3]));
  if (v[2] <= 0.0) return 1.0 - v[3] * v[3] * v[3] / ((v[3] - v[0]) * (v[3] - v[1]) * (v[3] - v[2]));
  // Two corners on either side: a wedge of three tetrahedra. a, b, c, d: where the edges 0-2, 0-3, 1-2, 1-3 are cut.
  const double a = v[0] / (v[0] - v[2]), b = v[0] / (v[0] - v[3]);
  const double c = v[1] / (v[1] - v[2]), d = v[1] / (v[1] - v[3]);
  return a * b * (1.0 - d) + a * (1.0 - c) * d + c * d;
}

}  // namespace

double SignedDistance::sample(const Vec3d& X) const {
  std::array<int, 3> cell;
  std::array<double, 3> t;
  double outside_squared = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == flat) {
      cell[axis] = 0;
      t[axis] = 0.0;
      continue;
    }
    const double last = size[axis] - 1;
    const double position = (X[axis] - origin[axis]) / spacing;
    const double clamped = position > 0.0 ? std::min(position, last) : 0.0;
    cell[axis] = std::min(static_cast<int>(clamped), size[axis] - 2);
    t[axis] = clamped - cell[axis];
    outside_squared += (position - clamped) * (position - clamped);
  }
  const std::size_t row = size[0], slab = row * size[1];
  const float* v = values.data() + index(cell[0], cell[1], cell[2]);
  const auto along_x = [&](std::size_t at) { return v[at] + t[0] * (static_cast<double>(v[at + 1]) - v[at]); };
  const double y0 = along_x(0) + t[1] * (along_x(row) - along_x(0));
  const double y1 = along_x(slab) + t[1] * (along_x(slab + row) - along_x(slab));
  const double phi = y0 + t[2] * (y1 - y0);
  return outside_squared > 0.0 || outside_squared != outside_squared ? phi + spacing * std::sqrt(outside_squared) : phi;
}

Vec3d SignedDistance::gradient(const Vec3d& X) const {
  Vec3d result;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d before = X, after = X;
    before[axis] -= 0.5 * spacing;
    after[axis] += 0.5 * spacing;
    result[axis] = (sample(after) - sample(before)) / spacing;
  }
  return result;
}

double SignedDistance::volume() const {
  double cells = 0.0;
  for (int k = 0; k + 1 < size[2]; ++k) {
    for (int j = 0; j + 1 < size[1]; ++j) {
      double row = 0.0;  // sums per row keep the rounding small
      for (int i = 0; i + 1 < size[0]; ++i) {
        std::array<double, 8> phi;
        int negative = 0;
        for (int c = 0; c < 8; ++c) {
          phi[c] = values[index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1))];
          negative += phi[c] < 0.0;
        }
        if (negative == 0) continue;
        if (negative == 8) {
          row += 1.0;
          continue;
        }
        for (const auto& corner : kKuhnTetrahedra)
          row += negative_fraction({phi[corner[0]], phi[corner[1]], phi[corner[2]], phi[corner[3]]}) / 6.0;
      }
      cells += row;
    }
  }
  return cells * spacing * spacing * spacing;
}

}  // namespace efsi::geometry
