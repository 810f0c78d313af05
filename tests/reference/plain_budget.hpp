// Purpose: slow readable twin of fluid/conserve_smoke where there is room for what is missing: every function
// at every cell, in double precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "grid/grid.hpp"

namespace efsi::reference {

// All functions along an axis at x, in cells: intervals of 8, the last one longer.
inline std::vector<double> hats(int cells, bool periodic, double x) {
  const int count = std::max(1, cells / 8);
  const auto fold = [&](int q) { return periodic ? (q % count + count) % count : std::clamp(q, 0, count - 1); };
  const auto width = [&](int q) { return fold(q) == count - 1 ? cells - 8.0 * (count - 1) : 8.0; };
  if (periodic) x -= cells * std::floor(x / cells);
  x = std::clamp(x, 0.0, static_cast<double>(cells));
  const int q = std::min(static_cast<int>(x / 8), count - 1);
  const double p = (x - 8 * q) / width(q);
  const double before = width(q) / (width(q) + width(q - 1)) * (1 - p) * (1 - p);
  const double after = width(q) / (width(q) + width(q + 1)) * p * p;
  std::vector<double> w(static_cast<std::size_t>(count), 0.0);
  w[static_cast<std::size_t>(fold(q - 1))] += before;
  w[static_cast<std::size_t>(fold(q))] += 1 - before - after;
  w[static_cast<std::size_t>(fold(q + 1))] += after;
  return w;
}

// Products of the functions along the axes.
inline std::vector<double> hats(const grid::Grid& g, const Vec3d& x) {
  const auto along = [&](std::size_t a) { return hats(g.cells[a], g.periodic[a], x[static_cast<Eigen::Index>(a)]); };
  std::vector<double> w;
  for (double z : along(2))
    for (double y : along(1))
      for (double v : along(0)) w.push_back(v * y * z);
  return w;
}

// back: how far it is from a cell to where its content comes from; blocks of 2^3 cells, by two opposite corners, move
// as one.
inline std::vector<Real> kept_scalar(const grid::Grid& g, const std::vector<Real>& before,
                                     const std::vector<Real>& after, const grid::VectorField& back) {
  const auto cells = [&](const auto& body) {
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i) body(g.cell(i, j, k), Vec3i{i, j, k});
  };
  const auto top = static_cast<double>(*std::max_element(before.begin(), before.end()));
  const auto room = [&](std::size_t c) {
    const double v = static_cast<double>(after[c]);
    return v * (1 - v / top);
  };
  std::vector<double> missing(hats(g, Vec3d::Zero()).size(), 0.0), space = missing;
  const auto add = [](std::vector<double>& sum, const std::vector<double>& w, double amount) {
    for (std::size_t f = 0; f < w.size(); ++f) sum[f] += w[f] * amount;
  };
  cells([&](std::size_t c, const Vec3i& index) {
    const Vec3d x = Vec3d(index[0], index[1], index[2]) + Vec3d::Constant(0.5);
    const double r = static_cast<double>(after[c]);
    Vec3i low = index, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] -= index[a] % 2;
      high[a] = std::min(low[a] + 1, g.cells[a] - 1);
    }
    const Vec3d middle = 0.5 * Vec3d(low[0] + high[0] + 1, low[1] + high[1] + 1, low[2] + high[2] + 1);
    Vec3d from;
    for (int a = 0; a < 3; ++a)
      from[a] = middle[a] + 0.5 * static_cast<double>(back.at(g.cell(low[0], low[1], low[2]))[a] +
                                                      back.at(g.cell(high[0], high[1], high[2]))[a]);
    const std::vector<double> here = hats(g, x);
    add(missing, here, static_cast<double>(before[c]) - r);
    add(missing, hats(g, middle), r);
    add(missing, hats(g, from), -r);
    add(space, here, room(c));
  });
  std::vector<Real> result(after);
  cells([&](std::size_t c, const Vec3i& index) {
    const std::vector<double> here = hats(g, Vec3d(index[0], index[1], index[2]) + Vec3d::Constant(0.5));
    double share = 0.0;
    for (std::size_t f = 0; f < here.size(); ++f) share += here[f] * missing[f] / space[f];
    result[c] += static_cast<Real>(share * room(c));
  });
  return result;
}

}  // namespace efsi::reference
