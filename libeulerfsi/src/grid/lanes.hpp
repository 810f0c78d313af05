// Purpose: trilinear interpolation for eight neighbours of a row at once, without gathers. What they read lies around
// them at places that differ little. Mostly all of it lies in one cell, as seen from each (Cell); where the
// displacements change sign three taps along each axis, the same for all eight, hold it (Place): the weights differ,
// the loads do not. Where that fails, and near the faces of the box, packed_field.hpp goes point by point.
// Displacements are in cells, from the point itself.
#pragma once

#include "grid/packed_field.hpp"

namespace efsi::grid {

inline constexpr int kLanes = 8;
using OctetIndex = int __attribute__((vector_size(kLanes * sizeof(int))));

EFSI_INLINE Octet octet(Real value) { return Octet{} + value; }
EFSI_INLINE Octet smaller(const Octet& a, const Octet& b) { return a < b ? a : b; }
EFSI_INLINE Octet larger(const Octet& a, const Octet& b) { return a > b ? a : b; }
EFSI_INLINE Real least(const Octet& v) {
  const Quad a = lower_half(v), b = upper_half(v), c = a < b ? a : b;
  const Real d = c[0] < c[1] ? c[0] : c[1], e = c[2] < c[3] ? c[2] : c[3];
  return d < e ? d : e;
}
EFSI_INLINE Real greatest(const Octet& v) { return -least(-v); }
using OctetMask = decltype(Octet{} < Octet{});
EFSI_INLINE bool all(const OctetMask& mask) {
  using Words = std::uint64_t __attribute__((vector_size(sizeof(Octet))));
  const auto words = reinterpret_cast<Words>(mask);
  std::uint64_t common = words[0];
  for (std::size_t w = 1; w < sizeof(Octet) / sizeof(std::uint64_t); ++w) common &= words[w];
  return common == ~std::uint64_t{0};
}
EFSI_INLINE bool any(const OctetMask& mask) { return !all(~mask); }

// Three components of eight points.
struct Octets {
  Octet c[3];
};
EFSI_INLINE Octets load_octets(const VectorField& field, std::size_t n) {
  return {{load_octet(field.c[0].data() + n), load_octet(field.c[1].data() + n), load_octet(field.c[2].data() + n)}};
}
EFSI_INLINE void store_octets(VectorField& field, std::size_t n, const Octets& v) {
  for (std::size_t a = 0; a < 3; ++a) store_octet(field.c[a].data() + n, v.c[a]);
}

// Samples fields of points[0] x points[1] x points[2] values, x fastest.
class LaneSampler {
 public:
  // The cell in which eight points read, as seen from each: its lowest point, from the first of them, where in it, and
  // whether none of these cells touches a face of the field.
  struct Cell {
    std::ptrdiff_t first;
    Octet part[3];
    bool inner;
  };
  // Where eight points read: the first of 3^3 taps, from the first point, and the weights of the taps.
  struct Place {
    std::ptrdiff_t first;
    Octet weight[3][3];
  };

  explicit LaneSampler(const Vec3i& points) {
    for (int a = 0; a < 3; ++a) points_[a] = points[static_cast<std::size_t>(a)];
    stride_[1] = points_[0];
    stride_[2] = stride_[1] * points_[1];
  }

  // For the points (i, j, k), ..., (i + 7, j, k) displaced by e. False: it is not one cell, or
  // leaves the field.
  EFSI_INLINE bool place(int i, int j, int k, const Octets& e, Cell& at) const {
    const int lower[3] = {i, j, k}, upper[3] = {i + kLanes - 1, j, k};
    const Octet zero{}, one = octet(1);
    OctetMask held = zero <= one;
    at.first = 0;
    at.inner = true;
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      const Real x = e.c[a][0];
      if (!(x >= -kFarthest && x <= kFarthest)) return false;
      const int whole = static_cast<int>(x), tap = whole - (static_cast<Real>(whole) > x);  // floor
      const int before = lower[a] + tap, behind = points_[a] - 2 - upper[a] - tap;          // points
      if (before < 0 || behind < 0) return false;
      at.inner = at.inner && before > 0 && behind > 0;
      at.first += stride_[a] * tap;
      at.part[a] = e.c[a] - static_cast<Real>(tap);
      held &= (at.part[a] >= zero) & (at.part[a] <= one);
    }
    return all(held);
  }

  // The same with three taps. False: they do not hold it, or leave the field.
  EFSI_INLINE bool place(int i, int j, int k, const Octets& e, Place& at) const {
    const int lower[3] = {i, j, k}, upper[3] = {i + kLanes - 1, j, k};
    at.first = 0;
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      const Real low = least(e.c[a]), high = greatest(e.c[a]);
      if (!(low >= -kFarthest && high <= kFarthest)) return false;
      int tap = static_cast<int>(low + kFarthest) - static_cast<int>(kFarthest);  // floor
      tap = std::min(tap, points_[a] - 3 - upper[a]);
      if (lower[a] + tap < 0 || !(high <= static_cast<Real>(tap + 2))) return false;
      at.first += stride_[a] * tap;
      const Octet x = e.c[a] - static_cast<Real>(tap), before = Real(1) - x, after = x - Real(1);
      at.weight[a][0] = larger(before, Octet{});
      at.weight[a][2] = larger(after, Octet{});
      at.weight[a][1] = Real(1) - (at.weight[a][0] + at.weight[a][2]);
    }
    return true;
  }

  // field: at the first point.
  EFSI_INLINE Octet value(const Real* field, const Cell& at) const {
    const Real* p = field + at.first;
    const std::ptrdiff_t y = stride_[1], z = stride_[2];
    const auto mix = [](const Octet& a, const Octet& b, const Octet& part)
                         EFSI_INLINE_LAMBDA { return a + part * (b - a); };
    const auto along = [&](const Real* row) EFSI_INLINE_LAMBDA {
      const Octet low = mix(load_octet(row), load_octet(row + z), at.part[2]);
      return mix(low, mix(load_octet(row + y), load_octet(row + y + z), at.part[2]), at.part[1]);
    };
    return mix(along(p), along(p + 1), at.part[0]);
  }
  EFSI_INLINE Octet value(const Real* field, const Place& at) const {
    const Real* p = field + at.first;
    Octet sum{};
#pragma GCC unroll 3
    for (int z = 0; z < 3; ++z) {
      Octet plane{};
#pragma GCC unroll 3
      for (int y = 0; y < 3; ++y) {
        const Real* row = p + z * stride_[2] + y * stride_[1];
        const Octet along = at.weight[0][0] * load_octet(row) + at.weight[0][1] * load_octet(row + 1) +
                            at.weight[0][2] * load_octet(row + 2);
        plane += at.weight[1][y] * along;
      }
      sum += at.weight[2][z] * plane;
    }
    return sum;
  }
  template <class At>
  EFSI_INLINE Octets value(const VectorField& field, std::size_t n, const At& at) const {
    return {{value(field.c[0].data() + n, at), value(field.c[1].data() + n, at), value(field.c[2].data() + n, at)}};
  }

  // v limited to the range of the field's values at the 8 corners of the cell that each point reads.
  EFSI_INLINE Octet limit(const Real* field, const Cell& at, const Octet& v) const {
    const Real* p = field + at.first;
    Octet low = load_octet(p), high = low;
#pragma GCC unroll 8
    for (int c = 1; c < 8; ++c) {
      const Octet corner = load_octet(p + (c & 1) + (c >> 1 & 1) * stride_[1] + (c >> 2) * stride_[2]);
      low = smaller(low, corner);
      high = larger(high, corner);
    }
    return smaller(larger(v, low), high);
  }
  EFSI_INLINE Octet limit(const Real* field, const Place& at, const Octet& v) const {
    const Real* p = field + at.first;
    Octet low[3], high[3];  // per plane
#pragma GCC unroll 3
    for (int z = 0; z < 3; ++z) {
      Octet row_low[3], row_high[3];
#pragma GCC unroll 3
      for (int y = 0; y < 3; ++y) {
        const Real* row = p + z * stride_[2] + y * stride_[1];
        const Octet middle = load_octet(row + 1), other = beside(0, at, load_octet(row), load_octet(row + 2));
        row_low[y] = smaller(middle, other);
        row_high[y] = larger(middle, other);
      }
      low[z] = smaller(row_low[1], beside(1, at, row_low[0], row_low[2]));
      high[z] = larger(row_high[1], beside(1, at, row_high[0], row_high[2]));
    }
    const Octet bottom = smaller(low[1], beside(2, at, low[0], low[2]));
    const Octet top = larger(high[1], beside(2, at, high[0], high[2]));
    return smaller(larger(v, bottom), top);
  }

  // Which of the points lie at most twice kBorder from the border of the cell that they read.
  EFSI_INLINE OctetMask at_border(const Cell& at) const {
    const auto side = [](const Octet& part) EFSI_INLINE_LAMBDA { return larger(part, Real(1) - part); };
    return larger(side(at.part[0]), larger(side(at.part[1]), side(at.part[2]))) > octet(1 - 2 * kBorder);
  }
  EFSI_INLINE OctetMask at_border(const Place& at) const {
    const auto most = [&](int a) EFSI_INLINE_LAMBDA {
      return larger(at.weight[a][0], larger(at.weight[a][1], at.weight[a][2]));
    };
    return larger(most(0), larger(most(1), most(2))) > octet(1 - 2 * kBorder);
  }

 private:
  static constexpr Real kFarthest = 64;  // cells; what goes farther is looked up point by point

  // Of the outer taps the one that is a corner of a point's cell; the middle one always is.
  EFSI_INLINE static Octet beside(int axis, const Place& at, const Octet& before, const Octet& after) {
    return at.weight[axis][0] > Octet{} ? before : after;
  }

  int points_[3];
  std::ptrdiff_t stride_[3] = {1, 0, 0};
};

}  // namespace efsi::grid
