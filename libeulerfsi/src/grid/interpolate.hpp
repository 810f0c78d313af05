// Purpose: trilinear interpolation of node and cell fields, back-traces.
// Positions are in grid units: g = (x - origin) / h.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/kernel.hpp"
#include "grid/grid.hpp"

namespace efsi::grid {

// Weights of the 8 corners around a position; positions outside are clamped to the box (wrapped where periodic).
struct Trilinear {
  std::size_t base;
  Real w[8];
};

// points: number of samples per axis; period: 0 or the length after which an axis repeats.
EFSI_INLINE Trilinear trilinear(const Vec3& g, const Vec3i& points, const std::array<std::size_t, 3>& stride) {
  int lower[3];
  Real f[3];
  for (int a = 0; a < 3; ++a) {
    const Real top = static_cast<Real>(points[static_cast<std::size_t>(a)] - 1);
    const Real x = std::min(std::max(g[a], Real(0)), top);
    lower[a] = std::min(static_cast<int>(x), std::max(0, points[static_cast<std::size_t>(a)] - 2));
    f[a] = x - static_cast<Real>(lower[a]);
  }
  Trilinear t;
  t.base = static_cast<std::size_t>(lower[0]) + stride[1] * static_cast<std::size_t>(lower[1]) +
           stride[2] * static_cast<std::size_t>(lower[2]);
  const Real x0 = 1 - f[0], x1 = f[0], y0 = 1 - f[1], y1 = f[1], z0 = 1 - f[2], z1 = f[2];
  t.w[0] = x0 * y0 * z0;
  t.w[1] = x1 * y0 * z0;
  t.w[2] = x0 * y1 * z0;
  t.w[3] = x1 * y1 * z0;
  t.w[4] = x0 * y0 * z1;
  t.w[5] = x1 * y0 * z1;
  t.w[6] = x0 * y1 * z1;
  t.w[7] = x1 * y1 * z1;
  return t;
}

inline Real wrap(Real x, Real length) { return x - std::floor(x / length) * length; }

// Samples node fields of one grid.
class NodeSampler {
 public:
  explicit NodeSampler(const Grid& g)
      : points_(g.nodes()), stride_{1, g.node_stride(1), g.node_stride(2)}, corner_(corner_offsets(g)) {
    for (std::size_t a = 0; a < 3; ++a) period_[a] = g.periodic[a] ? static_cast<Real>(g.cells[a]) : Real(0);
  }
  EFSI_INLINE Trilinear stencil(Vec3 g) const {
    for (int a = 0; a < 3; ++a)
      if (period_[static_cast<std::size_t>(a)] > 0) g[a] = wrap(g[a], period_[static_cast<std::size_t>(a)]);
    return trilinear(g, points_, stride_);
  }
  Real value(const Trilinear& t, const Real* field) const {
    Real sum = 0;
    for (std::size_t a = 0; a < 8; ++a) sum += t.w[a] * field[t.base + corner_[a]];
    return sum;
  }
  EFSI_INLINE Vec3 value(const Trilinear& t, const VectorField& v) const {
    const Real *x = v.c[0].data() + t.base, *y = v.c[1].data() + t.base, *z = v.c[2].data() + t.base;
    Real sum[3] = {0, 0, 0};
    for (std::size_t a = 0; a < 8; ++a) {
      sum[0] += t.w[a] * x[corner_[a]];
      sum[1] += t.w[a] * y[corner_[a]];
      sum[2] += t.w[a] * z[corner_[a]];
    }
    return {sum[0], sum[1], sum[2]};
  }
  EFSI_INLINE Vec3 vector(const VectorField& v, const Vec3& g) const { return value(stencil(g), v); }
  const std::array<std::size_t, 8>& corners() const { return corner_; }

 private:
  Vec3i points_;
  std::array<std::size_t, 3> stride_;
  std::array<std::size_t, 8> corner_;
  std::array<Real, 3> period_{};
};

// Position from which the flow arrives at g after `step` = dt/h: third-order Runge-Kutta (Ralston) through a velocity
// field frozen in time. v0: velocity at g. A negative step traces forwards.
EFSI_INLINE Vec3 trace_rk3(const NodeSampler& sampler, const VectorField& velocity, const Vec3& g, const Vec3& v0,
                           Real step) {
  const Vec3 v1 = sampler.vector(velocity, g - Real(0.5) * step * v0);
  const Vec3 v2 = sampler.vector(velocity, g - Real(0.75) * step * v1);
  return g - step * (Real(2.0 / 9.0) * v0 + Real(3.0 / 9.0) * v1 + Real(4.0 / 9.0) * v2);
}

// The same by the midpoint rule: second order, one interpolation instead of two.
EFSI_INLINE Vec3 trace_midpoint(const NodeSampler& sampler, const VectorField& velocity, const Vec3& g, const Vec3& v0,
                                Real step) {
  return g - step * sampler.vector(velocity, g - Real(0.5) * step * v0);
}

}  // namespace efsi::grid
