#include "solid/element/stiffness_block.hpp"

#include <algorithm>
#include <cstring>

#include "base/kernel.hpp"
#include "base/parallel.hpp"
#include "solid/hexahedron.hpp"

namespace efsi::solid {
namespace {

struct GaussGradients {
  Real g[8][8][3];  // point, corner, axis: h grad N
  GaussGradients() {
    for (int q = 0; q < 8; ++q) {
      const ShapeGradients source = gradients_at(quadrature_point(q, 8, Vec3d::Zero()));
      for (std::size_t a = 0; a < 8; ++a)
        for (int i = 0; i < 3; ++i) g[q][a][i] = static_cast<Real>(source[a][i]);
    }
  }
};

const GaussGradients& gauss_gradients() {
  static const GaussGradients table;
  return table;
}

using Lanes = Real[kBlock];
constexpr int kLanes = kBlock;

// out += x y, lane by lane
EFSI_INLINE void add_product(const Real* x, const Real* y, Real* out) {
#pragma omp simd
  for (int l = 0; l < kLanes; ++l) out[l] += x[l] * y[l];
}
EFSI_INLINE void add_scaled(Real s, const Real* x, Real* out) {
#pragma omp simd
  for (int l = 0; l < kLanes; ++l) out[l] += s * x[l];
}
EFSI_INLINE void clear(Real* out, int rows) {
#pragma omp simd
  for (int i = 0; i < rows * kLanes; ++i) out[i] = 0;
}

// One value of each element of a block: what a loop over the lanes would do, in registers.
typedef Real Block __attribute__((vector_size(kBlock * sizeof(Real))));

EFSI_INLINE Block load(const Real* row) {
  Block lanes;
  std::memcpy(&lanes, row, sizeof(lanes));
  return lanes;
}
EFSI_INLINE void store(const Block& lanes, Real* row) { std::memcpy(row, &lanes, sizeof(lanes)); }
EFSI_INLINE Block dot(const Block& a0, const Block& b0, const Block& a1, const Block& b1, const Block& a2,
                      const Block& b2) {
  return (a0 * b0 + a1 * b1) + a2 * b2;
}

// e -> U T(U^T e U) U^T, matrices (i, j) at i + 3 j; u: U.
EFSI_INLINE void respond(const PointBlock& p, const Block* u, Block* e) {
  Block half[9], t[9];
  // e -> U^T e U
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) half[i + 3 * j] = dot(e[i], u[3 * j], e[i + 3], u[1 + 3 * j], e[i + 6], u[2 + 3 * j]);
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i)
      e[i + 3 * j] = dot(u[3 * i], half[3 * j], u[1 + 3 * i], half[1 + 3 * j], u[2 + 3 * i], half[2 + 3 * j]);
  // t = T(e)
  constexpr int kNormal[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}}, kFirst[3] = {1, 2, 0}, kSecond[3] = {2, 0, 1};
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i)
    t[4 * i] = dot(load(p.normal[kNormal[i][0]]), e[0], load(p.normal[kNormal[i][1]]), e[4],
                   load(p.normal[kNormal[i][2]]), e[8]);
#pragma GCC unroll 3
  for (int q = 0; q < 3; ++q) {
    const int ij = kFirst[q] + 3 * kSecond[q], ji = kSecond[q] + 3 * kFirst[q];
    const Block own = load(p.pair[3 * q]), other = load(p.pair[3 * q + 1]), last = load(p.pair[3 * q + 2]);
    t[ij] = own * e[ij] + other * e[ji];
    t[ji] = other * e[ij] + last * e[ji];
  }
  // e = U t U^T
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) half[i + 3 * j] = dot(t[i], u[j], t[i + 3], u[j + 3], t[i + 6], u[j + 6]);
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i)
      e[i + 3 * j] = dot(u[i], half[3 * j], u[i + 3], half[1 + 3 * j], u[i + 6], half[2 + 3 * j]);
}

EFSI_INLINE void load_axes(const PointBlock& p, Block* u) {
#pragma GCC unroll 9
  for (int q = 0; q < 9; ++q) u[q] = load(p.axes[q]);
}

// out += B^T U T(U^T (B x) U) U^T, B = grad N / h, at one quadrature point.
EFSI_KERNEL void add_point(const PointBlock& p, const Real (*grad)[3], Real inverse_h, const Lanes* x, Lanes* out) {
  Block u[9], e[9];
#pragma GCC unroll 9
  for (int q = 0; q < 9; ++q) e[q] = Block{};
  for (int a = 0; a < 8; ++a)
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
      for (int i = 0; i < 3; ++i) e[i + 3 * j] += (grad[a][j] * inverse_h) * load(x[3 * a + i]);
  load_axes(p, u);
  respond(p, u, e);
  for (int a = 0; a < 8; ++a)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
      Block sum = load(out[3 * a + i]);
#pragma GCC unroll 3
      for (int j = 0; j < 3; ++j) sum += (grad[a][j] * inverse_h) * e[i + 3 * j];
      store(sum, out[3 * a + i]);
    }
}

// h grad N of corner a at the point of a one-point element.
EFSI_INLINE void set_gradient(const PointBlock& p, std::size_t a, Lanes* grad) {
  Lanes at[3];
  Real side[3];
  for (int j = 0; j < 3; ++j) {
    side[j] = grid::kCorner[a][j] ? Real(1) : Real(-1);
#pragma omp simd
    for (int l = 0; l < kLanes; ++l) at[j][l] = Real(0.5) + Real(0.5) * side[j] * p.local[j][l];
  }
#pragma omp simd
  for (int l = 0; l < kLanes; ++l) {
    grad[0][l] = side[0] * at[1][l] * at[2][l];
    grad[1][l] = at[0][l] * side[1] * at[2][l];
    grad[2][l] = at[0][l] * at[1][l] * side[2];
  }
}

// The same at point q of `points`.
void set_gradient(const PointBlock& p, std::size_t points, std::size_t q, std::size_t a, Lanes* grad) {
  if (points == 1) return set_gradient(p, a, grad);
  for (std::size_t j = 0; j < 3; ++j) std::fill(grad[j], grad[j] + kLanes, gauss_gradients().g[q][a][j]);
}

// Corner values, at 3 a + i, become sums of them with signs, at 3 m + i: where bit j of m is set the sign is that of
// the corner's side along axis j. m = 1, 2, 4 is what the gradient at the centre sees; 3, 5, 6, 7 are the hourglass
// modes, by which it differs elsewhere. `back`: its transpose.
template <bool back>
EFSI_INLINE void exchange_modes(Block* v) {
#pragma GCC unroll 3
  for (int bit = 1; bit < 8; bit *= 2)
#pragma GCC unroll 8
    for (int low = 0; low < 8; ++low) {
      if (low & bit) continue;
#pragma GCC unroll 3
      for (int i = 0; i < 3; ++i) {
        Block &a = v[3 * low + i], &b = v[3 * (low + bit) + i];
        const Block first = a, second = b;
        a = back ? first - second : second + first;
        b = back ? first + second : second - first;
      }
    }
}

// The modes of the gradient along axis j at a point: that at the centre and three others, times products of the
// point's local coordinates.
constexpr int kGradient[3][4] = {{1, 3, 5, 7}, {2, 3, 6, 7}, {4, 5, 6, 7}};

// Products of local coordinates by which modes 1 to 3 of kGradient count.
EFSI_INLINE void set_shares(const PointBlock& p, Block (*other)[3]) {
  constexpr int kFirst[3] = {1, 0, 0}, kSecond[3] = {2, 2, 1};
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    other[j][0] = load(p.local[kFirst[j]]);
    other[j][1] = load(p.local[kSecond[j]]);
    other[j][2] = other[j][0] * other[j][1];
  }
}

EFSI_INLINE bool at_centers(const PointBlock& p) {
  Real sum = 0;
  for (const auto& lanes : p.local)
#pragma omp simd reduction(+ : sum)
    for (int l = 0; l < kLanes; ++l) sum += lanes[l] * lanes[l];
  return !(sum > 0);
}

// out = factor K x with one quadrature point, at the centres of all of the block or not, and hourglass stiffness
// U diag(k / s^2) U^T.
template <bool centers>
EFSI_INLINE void multiply_one_point(const PointBlock& p, Real inverse_h, const Real* factor, const Lanes* x,
                                    Lanes* out) {
  constexpr int kHourglass[4] = {3, 5, 6, 7};
  const Real strain = Real(0.25) * inverse_h;
  const Block forces = strain * load(factor), share = static_cast<Real>(kHourglassNorm * kHourglassNorm) * load(factor);
  // Modes of the corners, and the gradient at the quadrature point.
  Block v[24], e[9], u[9], shares[3][3];
#pragma GCC unroll 24
  for (int r = 0; r < 24; ++r) v[r] = load(x[r]);
  exchange_modes<false>(v);
  if (!centers) set_shares(p, shares);
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
      e[i + 3 * j] = strain * v[3 * kGradient[j][0] + i];
      if (!centers)
        e[i + 3 * j] += strain * dot(shares[j][0], v[3 * kGradient[j][1] + i], shares[j][1], v[3 * kGradient[j][2] + i],
                                     shares[j][2], v[3 * kGradient[j][3] + i]);
    }
  // Stress, and its forces on the linear modes.
  load_axes(p, u);
  respond(p, u, e);
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) v[i] = Block{};  // nothing from what all corners share
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
      e[i + 3 * j] *= forces;
      v[3 * kGradient[j][0] + i] = e[i + 3 * j];
    }
  // Hourglass stiffness in the axes of the element; away from the centre the stress also acts on these modes.
  Block stiffness[3];
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) stiffness[j] = share * load(p.hourglass[j + 1]);
#pragma GCC unroll 4
  for (int n = 0; n < 4; ++n) {
    const int m = kHourglass[n];
    Block along[3];
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j)
      along[j] = dot(u[3 * j], v[3 * m], u[1 + 3 * j], v[3 * m + 1], u[2 + 3 * j], v[3 * m + 2]) * stiffness[j];
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
      v[3 * m + i] = dot(u[i], along[0], u[i + 3], along[1], u[i + 6], along[2]);
      if (centers) continue;
#pragma GCC unroll 3
      for (int j = 0; j < 3; ++j)
#pragma GCC unroll 3
        for (int k = 0; k < 3; ++k)
          if (kGradient[j][k + 1] == m) v[3 * m + i] += shares[j][k] * e[i + 3 * j];
    }
  }
  exchange_modes<true>(v);
#pragma GCC unroll 24
  for (int r = 0; r < 24; ++r) store(v[r], out[r]);
}

EFSI_KERNEL void multiply_at_centers(const PointBlock& p, Real inverse_h, const Real* factor, const Lanes* x,
                                     Lanes* out) {
  multiply_one_point<true>(p, inverse_h, factor, x, out);
}
EFSI_KERNEL void multiply_anywhere(const PointBlock& p, Real inverse_h, const Real* factor, const Lanes* x,
                                   Lanes* out) {
  multiply_one_point<false>(p, inverse_h, factor, x, out);
}

// out += the diagonal of the above for one corner: E = e_i b^T, b = U^T grad N / h.
EFSI_KERNEL void add_diagonal(const PointBlock& p, const Lanes* grad, Real inverse_h, Lanes* out) {
  Lanes b[3];
  clear(b[0], 3);
  for (int m = 0; m < 3; ++m)
    for (int j = 0; j < 3; ++j) {
      const Real *slope = grad[j], *axis = p.axes[j + 3 * m];
#pragma omp simd
      for (int l = 0; l < kLanes; ++l) b[m][l] += slope[l] * inverse_h * axis[l];
    }
  constexpr int kFirst[3] = {1, 2, 0}, kSecond[3] = {2, 0, 1};
  for (int i = 0; i < 3; ++i) {
    const Real *u0 = p.axes[i], *u1 = p.axes[i + 3], *u2 = p.axes[i + 6];
#pragma omp simd
    for (int l = 0; l < kLanes; ++l) {
      const Real e0 = u0[l] * b[0][l], e1 = u1[l] * b[1][l], e2 = u2[l] * b[2][l];
      out[i][l] += (p.normal[0][l] * e0 * e0 + p.normal[1][l] * e1 * e1 + p.normal[2][l] * e2 * e2) +
                   2 * (p.normal[3][l] * e1 * e2 + p.normal[4][l] * e2 * e0 + p.normal[5][l] * e0 * e1);
    }
    for (int q = 0; q < 3; ++q) {
      const Real *first = p.axes[i + 3 * kFirst[q]], *second = p.axes[i + 3 * kSecond[q]];
      const Real *b_first = b[kFirst[q]], *b_second = b[kSecond[q]];
#pragma omp simd
      for (int l = 0; l < kLanes; ++l) {
        const Real ij = first[l] * b_second[l], ji = second[l] * b_first[l];
        out[i][l] += p.pair[3 * q][l] * ij * ij + 2 * p.pair[3 * q + 1][l] * ij * ji + p.pair[3 * q + 2][l] * ji * ji;
      }
    }
  }
}

// The same of the hourglass modes: U diag(k / s^2) U^T.
EFSI_KERNEL void set_hourglass_diagonal(const PointBlock& p, Lanes* out) {
  clear(out[0], 24);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Real *u = p.axes[i + 3 * j], *k = p.hourglass[j + 1];
#pragma omp simd
      for (int l = 0; l < kLanes; ++l)
        out[i][l] += static_cast<Real>(4 * kHourglassNorm * kHourglassNorm) * u[l] * k[l] * u[l];
    }
    for (int a = 1; a < 8; ++a) std::copy(out[i], out[i] + kLanes, out[3 * a + i]);
  }
}

// out -= tau grad N / h at one corner
EFSI_KERNEL void subtract_stress(const PointBlock& p, const Lanes* grad, Real inverse_h, Lanes* out) {
  constexpr int kStress[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Real *stress = p.stress[kStress[i][j]], *slope = grad[j];
#pragma omp simd
      for (int l = 0; l < kLanes; ++l) out[i][l] -= inverse_h * slope[l] * stress[l];
    }
}

// out += k F^-T u on the hourglass modes, F^-1 = 1 - grad u
EFSI_KERNEL void add_hourglass_force(const PointBlock& p, Real inverse_h, const Lanes* u, Lanes* out) {
  Lanes inverse_f[9], grad[3];  // (i, j) at i + 3 j
  for (int q = 0; q < 9; ++q) std::fill(inverse_f[q], inverse_f[q] + kLanes, Real(q % 4 == 0));
  for (int a = 0; a < 8; ++a) {
    set_gradient(p, static_cast<std::size_t>(a), grad);
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        Real* f = inverse_f[i + 3 * j];
#pragma omp simd
        for (int l = 0; l < kLanes; ++l) f[l] -= inverse_h * grad[j][l] * u[3 * a + i][l];
      }
  }
  for (const auto& sign : kHourglassSign) {
    Lanes amplitude[3], force[3];
    clear(amplitude[0], 3);
    clear(force[0], 3);
    for (int a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i)
        add_scaled(static_cast<Real>(sign[a] * kHourglassNorm * kHourglassNorm), u[3 * a + i], amplitude[i]);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) add_product(inverse_f[j + 3 * i], amplitude[j], force[i]);
    for (int i = 0; i < 3; ++i)
#pragma omp simd
      for (int l = 0; l < kLanes; ++l) force[i][l] *= -p.hourglass[0][l];  // X = -u on these modes
    for (int a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i) add_scaled(static_cast<Real>(sign[a]), force[i], out[3 * a + i]);
  }
}

// out += that of a solid that can yield
void add_hourglass_force(const SolidWork& work, std::size_t block, Lanes* out) {
  const std::size_t lanes = std::min(kBlock, work.hourglass_force.size() - block * kBlock);
  for (std::size_t m = 0; m < 4; ++m)
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t lane = 0; lane < lanes; ++lane)
          out[3 * a + i][lane] +=
              static_cast<Real>(kHourglassSign[m][a]) * work.hourglass_force[block * kBlock + lane][3 * m + i];
}

EFSI_KERNEL void scale(const Real* factor, Lanes* out) {
  for (int i = 0; i < 24; ++i) {
#pragma omp simd
    for (int l = 0; l < kLanes; ++l) out[i][l] *= factor[l];
  }
}

}  // namespace

void block_stiffness(const SolidWork& work, std::size_t block, double h, const Real* factor,
                     const Real (&x)[24][kBlock], Real* out) {
  auto* rows = reinterpret_cast<Lanes*>(out);
  const Real inverse_h = static_cast<Real>(1.0 / h);
  const auto points = static_cast<std::size_t>(work.points_per_element);
  if (points == 1) {
    const PointBlock& p = work.point[block];
    if (at_centers(p))
      multiply_at_centers(p, inverse_h, factor, x, rows);
    else
      multiply_anywhere(p, inverse_h, factor, x, rows);
    return;
  }
  std::fill(out, out + 24 * kBlock, Real(0));
  for (std::size_t q = 0; q < points; ++q)
    add_point(work.point[block * points + q], gauss_gradients().g[q], inverse_h, x, rows);
  scale(factor, rows);
}

void block_stiffness_diagonal(const SolidWork& work, std::size_t block, double h, const Real* factor, Real* out) {
  auto* rows = reinterpret_cast<Lanes*>(out);
  const auto points = static_cast<std::size_t>(work.points_per_element);
  if (points == 1)
    set_hourglass_diagonal(work.point[block], rows);
  else
    std::fill(out, out + 24 * kBlock, Real(0));
  Lanes grad[3];
  for (std::size_t q = 0; q < points; ++q)
    for (std::size_t a = 0; a < 8; ++a) {
      const PointBlock& p = work.point[block * points + q];
      set_gradient(p, points, q, a, grad);
      add_diagonal(p, grad, static_cast<Real>(1.0 / h), rows + 3 * a);
    }
  scale(factor, rows);
}

// By two traces that turning does not change: an isotropic stiffness has 9 K = 9 lambda + 6 mu over the normal
// components, and 3 lambda + 12 mu over the diagonal.
BlockModuli block_moduli(const SolidWork& work, std::size_t block) {
  Lanes bulk = {}, all = {};  // 9 K, 3 lambda + 12 mu
  const auto points = static_cast<std::size_t>(work.points_per_element);
  for (std::size_t q = 0; q < points; ++q) {
    const PointBlock& p = work.point[block * points + q];
    for (std::size_t i = 0; i < 3; ++i) {
      add_scaled(1, p.normal[i], bulk);
      add_scaled(2, p.normal[3 + i], bulk);
      add_scaled(1, p.normal[i], all);
      add_scaled(1, p.pair[3 * i], all);
      add_scaled(1, p.pair[3 * i + 2], all);
    }
  }
  BlockModuli moduli;
  for (int l = 0; l < kLanes; ++l) {
    moduli.mu[l] = (all[l] - bulk[l] / 3) / 10;
    moduli.lambda[l] = bulk[l] / 9 - moduli.mu[l] * 2 / 3;
  }
  return moduli;
}

void block_force(const SolidState& state, const SolidWork& work, std::size_t block, Real* out) {
  auto* rows = reinterpret_cast<Lanes*>(out);
  std::fill(out, out + 24 * kBlock, Real(0));
  const Grid& g = state.band.grid;
  const Real inverse_h = static_cast<Real>(1.0 / g.h);
  const auto points = static_cast<std::size_t>(work.points_per_element);
  Lanes grad[3];
  for (std::size_t q = 0; q < points; ++q)
    for (std::size_t a = 0; a < 8; ++a) {
      const PointBlock& p = work.point[block * points + q];
      set_gradient(p, points, q, a, grad);
      subtract_stress(p, grad, inverse_h, rows + 3 * a);
    }
  if (points != 1) return;
  if (!work.hourglass_force.empty()) {
    add_hourglass_force(work, block, rows);
    return;
  }
  const auto corner = grid::corner_offsets(g);
  Lanes u[24];
  for (std::size_t lane = 0; lane < kBlock; ++lane) {
    const std::size_t e = std::min(block * kBlock + lane, work.element_corner.size() - 1);  // a free lane: k = 0
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t i = 0; i < 3; ++i) u[3 * a + i][lane] = state.u.c[i][n + corner[a]];
  }
  add_hourglass_force(work.point[block], inverse_h, u, rows);
}

}  // namespace efsi::solid
