// Purpose: slow readable twin of fluid/advect: clamped MacCormack transport on plain fields, node by node.
#pragma once

#include <algorithm>

#include "grid/interpolate.hpp"

namespace efsi::reference {

inline Vec3 keep_inside(const grid::Grid& g, Vec3 x) {
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    if (!g.periodic[s]) x[a] = std::clamp(x[a], Real(0), static_cast<Real>(g.cells[s]));
  }
  return x;
}

// The part of v at a node that alternates along two axes or three, (-1 2 -1)/4, where it is smooth along the others,
// (1 2 1)/4; walls mirror v, periodic axes go on at the other end.
inline Vec3 hourglass_part(const grid::Grid& g, const grid::VectorField& v, const Vec3& node) {
  const auto beyond = [&](int a, int n) {
    const auto s = static_cast<std::size_t>(a);
    const int last = g.cells[s];
    if (n < 0) return g.periodic[s] ? n + last : -n;
    if (n > last) return g.periodic[s] ? n - last : 2 * last - n;
    return n;
  };
  Vec3 part = Vec3::Zero();
  for (int c = -1; c <= 1; ++c)
    for (int b = -1; b <= 1; ++b)
      for (int a = -1; a <= 1; ++a) {
        const int offset[3] = {a, b, c};
        Real weight = 0;
        for (const int alternating : {3, 5, 6, 7}) {  // bits: the axes
          Real product = 1;
          for (int axis = 0; axis < 3; ++axis)
            product *= offset[axis] == 0 ? Real(0.5) : ((alternating >> axis & 1) ? Real(-0.25) : Real(0.25));
          weight += product;
        }
        int n[3];
        for (int axis = 0; axis < 3; ++axis) n[axis] = beyond(axis, static_cast<int>(node[axis]) + offset[axis]);
        part += weight * v.at(g.node(n[0], n[1], n[2]));
      }
  return part;
}

// The velocity v carried by itself over step = dt/h; at nodes that are not free only the first sweep acts.
inline grid::VectorField carried_velocity(const grid::Grid& g, const grid::VectorField& v, Real step,
                                          const std::vector<std::uint8_t>& free) {
  const grid::NodeSampler sampler(g);
  grid::VectorField first = v, result;
  const auto cut_by_wall = [&](const Vec3& x, const Vec3& end) {
    for (int a = 0; a < 3; ++a) {
      const auto s = static_cast<std::size_t>(a);
      if (!g.periodic[s] && end[a] != x[a] && (end[a] <= 0 || end[a] >= static_cast<Real>(g.cells[s]))) return true;
    }
    return false;
  };
  const auto for_nodes = [&](const auto& body) {
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const Vec3 x(static_cast<Real>(i), static_cast<Real>(j), static_cast<Real>(k));
          const std::size_t n = g.node(i, j, k);
          const bool from_wall = cut_by_wall(x, x - Real(0.5) * step * v.at(n));
          body(n, x,
               keep_inside(g,
                           from_wall ? Vec3(x - step * v.at(n)) : grid::trace_midpoint(sampler, v, x, v.at(n), step)));
        }
  };
  for_nodes([&](std::size_t n, const Vec3&, const Vec3& from) { first.set(n, sampler.vector(v, from)); });
  result = first;
  for_nodes([&](std::size_t n, const Vec3& x, const Vec3& from) {
    if (!free[n]) return;
    const Vec3 to = keep_inside(g, from + 2 * step * v.at(n));
    const Vec3 taken = std::min(Real(1), step * v.at(n).norm()) * hourglass_part(g, first, x);
    result.set(n, first.at(n) - taken);
    if (cut_by_wall(x, from) || cut_by_wall(x, to)) return;
    const Vec3 w = first.at(n) + Real(0.5) * (v.at(n) - sampler.vector(first, to));
    const grid::Trilinear source = sampler.stencil(from);
    Vec3 low = v.at(source.base), high = low;
    for (std::size_t offset : sampler.corners()) {
      low = low.cwiseMin(v.at(source.base + offset));
      high = high.cwiseMax(v.at(source.base + offset));
    }
    const Vec3 inside = w.cwiseMax(low).cwiseMin(high);
    if (step * (inside - w).cwiseAbs().maxCoeff() <= Real(1e-4)) {  // cells
      result.set(n, inside - taken);
      return;
    }
    for (std::size_t c = 0; c < 8; ++c) {  // all cells within 1e-4 cells of the place
      const Vec3 side(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
      const grid::Trilinear beside = sampler.stencil(from + Real(1e-4) * side);
      for (std::size_t offset : sampler.corners()) {
        low = low.cwiseMin(v.at(beside.base + offset));
        high = high.cwiseMax(v.at(beside.base + offset));
      }
    }
    result.set(n, w.cwiseMax(low).cwiseMin(high) - taken);
  });
  return result;
}

// A cell field carried by v in the same direction.
inline std::vector<Real> carried_scalar(const grid::Grid& g, const grid::VectorField& v, Real step,
                                        const std::vector<Real>& field) {
  const grid::NodeSampler nodes(g);
  std::vector<Real> first(field.size()), result(field.size());
  struct Around {
    std::size_t cell[8];
    Real weight[8];
  };
  const auto around = [&](const Vec3& x) {
    Around at;
    for (std::size_t c = 0; c < 8; ++c) {
      int index[3];
      at.weight[c] = 1;
      for (int a = 0; a < 3; ++a) {
        const auto s = static_cast<std::size_t>(a);
        const int n = g.cells[s], o = grid::kCorner[c][a];
        Real p = x[a] - Real(0.5);
        p = g.periodic[s] ? grid::wrap(p, static_cast<Real>(n)) : std::clamp(p, Real(0), static_cast<Real>(n - 1));
        const int low = std::min(static_cast<int>(p), g.periodic[s] ? n - 1 : std::max(0, n - 2));
        index[a] = g.periodic[s] ? (low + o) % n : std::min(low + o, n - 1);
        at.weight[c] *= o ? p - static_cast<Real>(low) : 1 - (p - static_cast<Real>(low));
      }
      at.cell[c] = g.cell(index[0], index[1], index[2]);
    }
    return at;
  };
  const auto value = [](const std::vector<Real>& f, const Around& at) {
    Real sum = 0;
    for (int c = 0; c < 8; ++c) sum += at.weight[c] * f[at.cell[c]];
    return sum;
  };
  const auto for_cells = [&](const auto& body) {
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i) {
          const Vec3 x = (Vec3d(i, j, k) + Vec3d::Constant(0.5)).cast<Real>(), w = nodes.vector(v, x);
          body(g.cell(i, j, k), grid::trace_midpoint(nodes, v, x, w, step), w);
        }
  };
  for_cells(
      [&](std::size_t c, const Vec3& from, const Vec3&) { first[c] = value(field, around(keep_inside(g, from))); });
  for_cells([&](std::size_t c, const Vec3& from, const Vec3& w) {
    const Around source = around(keep_inside(g, from));
    Real low = field[source.cell[0]], high = low;
    for (std::size_t m : source.cell) {
      low = std::min(low, field[m]);
      high = std::max(high, field[m]);
    }
    const Real back = value(first, around(keep_inside(g, from + 2 * step * w)));
    result[c] = std::clamp(first[c] + Real(0.5) * (field[c] - back), low, high);
  });
  return result;
}

}  // namespace efsi::reference
