// Purpose: node vectors packed for fast trilinear interpolation: (x, y, z, 0) side by side, so that one load brings an
// edge of a cell and one instruction works on all components. interpolate.hpp is the simple reference.
// Positions are in grid units: g = (x - origin) / h. The interpolation is nested, z then y then x.
#pragma once

#include <limits>
#include <vector>

#include "base/kernel.hpp"
#include "grid/grid.hpp"

namespace efsi::grid {

using Quad = Real __attribute__((vector_size(4 * sizeof(Real))));   // x, y, z, 0
using Octet = Real __attribute__((vector_size(8 * sizeof(Real))));  // two neighbours along x
using QuadIndex = int __attribute__((vector_size(4 * sizeof(int))));

EFSI_INLINE Quad load_quad(const Real* p) {
  using Unaligned = Real __attribute__((vector_size(4 * sizeof(Real)), aligned(alignof(Real)), may_alias));
  return *reinterpret_cast<const Unaligned*>(p);
}
EFSI_INLINE Octet load_octet(const Real* p) {
  using Unaligned = Real __attribute__((vector_size(8 * sizeof(Real)), aligned(alignof(Real)), may_alias));
  return *reinterpret_cast<const Unaligned*>(p);
}
EFSI_INLINE void store_quad(Real* p, const Quad& v) {
  using Unaligned = Real __attribute__((vector_size(4 * sizeof(Real)), aligned(alignof(Real)), may_alias));
  *reinterpret_cast<Unaligned*>(p) = v;
}
EFSI_INLINE void store_octet(Real* p, const Octet& v) {
  using Unaligned = Real __attribute__((vector_size(8 * sizeof(Real)), aligned(alignof(Real)), may_alias));
  *reinterpret_cast<Unaligned*>(p) = v;
}
EFSI_INLINE Quad lower_half(const Octet& v) { return load_quad(reinterpret_cast<const Real*>(&v)); }
EFSI_INLINE Quad upper_half(const Octet& v) { return load_quad(reinterpret_cast<const Real*>(&v) + 4); }

// A value that is not a number gives the bound.
EFSI_INLINE Quad clamp(const Quad& v, const Quad& low, const Quad& high) {
  const Quad raised = v > low ? v : low;
  return raised < high ? raised : high;
}

// Four values per node.
class PackedField {
 public:
  // For at least so many nodes.
  void reserve(std::size_t nodes) {
    if (values_.size() < 4 * nodes) values_.resize(4 * nodes);
  }
  std::vector<Real>& storage() { return values_; }
  const Real* at(std::size_t n) const { return values_.data() + 4 * n; }
  Real* at(std::size_t n) { return values_.data() + 4 * n; }
  std::size_t bytes() const { return values_.capacity() * sizeof(Real); }

 private:
  std::vector<Real> values_;
};

// Two neighbours along x.
EFSI_INLINE Octet edge_of(const PackedField& field, std::size_t n) { return load_octet(field.at(n)); }
EFSI_INLINE Octet edge_of(const VectorField& field, std::size_t n) {
  const Real *x = field.c[0].data() + n, *y = field.c[1].data() + n, *z = field.c[2].data() + n;
  return Octet{x[0], y[0], z[0], 0, x[1], y[1], z[1], 0};
}

inline constexpr Real kBorder = Real(1e-4);  // cells: as far as rounding leads from the border of a cell

// Samples node fields of one grid, packed or by components.
class PackedSampler {
 public:
  // The cell around a position: its lowest node and where in it.
  struct Place {
    std::size_t node;
    Quad part;
  };

  explicit PackedSampler(const Grid& g) : row_(g.node_stride(1)), slab_(g.node_stride(2)) {
    for (std::size_t a = 0; a < 4; ++a) {
      const bool axis = a < 3;
      const int cells = axis ? g.cells[a] : 0;
      const bool periodic = axis && g.periodic[a];
      any_periodic_ = any_periodic_ || periodic;
      period_[a] = periodic ? static_cast<Real>(cells) : Real(0);
      divisor_[a] = periodic ? static_cast<Real>(cells) : Real(1);
      top_[a] = static_cast<Real>(cells);
      last_[a] = static_cast<Real>(axis ? cells - 1 : 0);
      low_[a] = periodic ? -std::numeric_limits<Real>::max() : Real(0);
      high_[a] = periodic ? std::numeric_limits<Real>::max() : top_[a];
    }
  }

  // The nearest position in the box; periodic axes have no end.
  EFSI_INLINE Quad keep_inside(const Quad& g) const { return clamp(g, low_, high_); }

  // The same up to `margin` beyond the box.
  EFSI_INLINE Quad keep_near(const Quad& g, Real margin) const { return clamp(g, low_ - margin, high_ + margin); }

  // Whether keep_inside has cut a trace from x to `end`: nothing is known of what comes from beyond a wall.
  EFSI_INLINE bool cut_by_wall(const Quad& x, const Quad& end) const {
    const auto cut = (end != x) & ((end <= low_) | (end >= high_));
    return (cut[0] | cut[1] | cut[2]) != 0;
  }

  // Whether a position is in the box or up to `margin` beyond it.
  EFSI_INLINE bool is_near(const Quad& g, Real margin) const {
    const auto out = (g < low_ - margin) | (g > high_ + margin);
    return (out[0] | out[1] | out[2]) == 0;
  }

  // Positions outside are clamped to the box, or wrapped where periodic.
  EFSI_INLINE Place place(const Quad& g) const {
    const Quad wrapped = wrap(g), inside = clamp(wrapped, Quad{0, 0, 0, 0}, top_), lower = lower_corner(inside);
    return {node_at(lower), inside - lower};
  }
  // Positions outside belong to the nearest cell, which extrapolates.
  EFSI_INLINE Place place_beyond(const Quad& g) const {
    const Quad wrapped = wrap(g), lower = lower_corner(clamp(wrapped, Quad{0, 0, 0, 0}, top_));
    return {node_at(lower), wrapped - lower};
  }
  template <class Field>
  EFSI_INLINE Quad value(const Field& field, const Place& at) const {
    const Real x = at.part[0], y = at.part[1], z = at.part[2];
    const Octet a = edge_of(field, at.node), b = edge_of(field, at.node + row_);
    const Octet low = a + z * (edge_of(field, at.node + slab_) - a);
    const Octet high = b + z * (edge_of(field, at.node + slab_ + row_) - b);
    const Octet edge = low + y * (high - low);
    const Quad first = lower_half(edge);
    return first + x * (upper_half(edge) - first);
  }
  template <class Field>
  EFSI_INLINE Quad value(const Field& field, const Quad& g) const {
    return value(field, place(g));
  }

  // v limited to the range of the field's values at the 8 corners around a position.
  template <class Field>
  EFSI_INLINE Quad limit(const Field& field, const Place& at, const Quad& v) const {
    const Range corners = range(field, at);
    return clamp(v, corners.low, corners.high);
  }
  // The same, but at most kBorder away from other cells to the range of them all: rounding must not choose the cell.
  template <class Field>
  EFSI_INLINE Quad limit_at_border(const Field& field, const Quad& g, const Quad& v) const {
    Range all = range(field, place(g));
    for (int c = 0; c < 8; ++c) {
      const Quad side = {c & 1 ? kBorder : -kBorder, c & 2 ? kBorder : -kBorder, c & 4 ? kBorder : -kBorder, 0};
      const Range cell = range(field, place(g + side));
      all.low = cell.low < all.low ? cell.low : all.low;
      all.high = cell.high > all.high ? cell.high : all.high;
    }
    return clamp(v, all.low, all.high);
  }

  // Where the flow that leads to g comes from, `step` = dt/h earlier: the midpoint rule; v: velocity at g.
  template <class Field>
  EFSI_INLINE Quad trace_midpoint(const Field& velocity, const Quad& g, const Quad& v, Real step) const {
    return g - step * value(velocity, g - Real(0.5) * step * v);
  }
  // The same by third-order Runge-Kutta (Ralston). A negative step traces forwards.
  EFSI_INLINE Quad trace_rk3(const PackedField& velocity, const Quad& g, const Quad& v0, Real step) const {
    const Quad v1 = value(velocity, g - Real(0.5) * step * v0);
    const Quad v2 = value(velocity, g - Real(0.75) * step * v1);
    return g - step * (Real(2.0 / 9.0) * v0 + Real(3.0 / 9.0) * v1 + Real(4.0 / 9.0) * v2);
  }

 private:
  EFSI_INLINE Quad wrap(Quad g) const {
    if (any_periodic_) {  // the period of other axes is 0
      const Quad turns = g / divisor_;
      g -= __builtin_convertvector(__builtin_convertvector(turns, QuadIndex), Quad) * period_;
      g += g < 0 ? period_ : Quad{0, 0, 0, 0};
    }
    return g;
  }
  struct Range {
    Quad low, high;
  };
  // Of the field's values at the 8 corners around a position.
  template <class Field>
  EFSI_INLINE Range range(const Field& field, const Place& at) const {
    const Octet a = edge_of(field, at.node), b = edge_of(field, at.node + row_);
    const Octet c = edge_of(field, at.node + slab_), d = edge_of(field, at.node + slab_ + row_);
    const Octet low_ab = a < b ? a : b, low_cd = c < d ? c : d, low = low_ab < low_cd ? low_ab : low_cd;
    const Octet high_ab = a > b ? a : b, high_cd = c > d ? c : d, high = high_ab > high_cd ? high_ab : high_cd;
    const Quad l0 = lower_half(low), l1 = upper_half(low), h0 = lower_half(high), h1 = upper_half(high);
    return {l0 < l1 ? l0 : l1, h0 > h1 ? h0 : h1};
  }
  // inside: in the box
  EFSI_INLINE Quad lower_corner(const Quad& inside) const {
    const Quad whole = __builtin_convertvector(__builtin_convertvector(inside, QuadIndex), Quad);
    return whole < last_ ? whole : last_;
  }
  EFSI_INLINE std::size_t node_at(const Quad& lower) const {
    const QuadIndex index = __builtin_convertvector(lower, QuadIndex);
    return static_cast<std::size_t>(index[0]) + row_ * static_cast<std::size_t>(index[1]) +
           slab_ * static_cast<std::size_t>(index[2]);
  }

  std::size_t row_, slab_;
  bool any_periodic_ = false;
  Quad period_, divisor_, top_, last_, low_, high_;
};

}  // namespace efsi::grid
