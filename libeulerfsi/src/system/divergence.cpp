#include "system/divergence.hpp"

#include <algorithm>

#include "base/kernel.hpp"

namespace efsi::system {
namespace {

// Rows of -D^T p, scaled by the mobility: g = mobility (p_high - p_low), and of its divergence.
struct RowScratch {
  std::vector<Real> sum, dy, dz, fx, fyz, out, zero;
  explicit RowScratch(const Grid& g) {
    for (auto* v : {&sum, &dy, &dz, &fx, &fyz, &out, &zero}) v->resize(static_cast<std::size_t>(g.cells[0] + 2));
  }
};

// g along one row of n + 1 nodes from the four rows of n + 2 cells around it.
EFSI_KERNEL void gradient_row(int n, const Real* p00, const Real* p10, const Real* p01, const Real* p11, const Real* w,
                              Real* sum, Real* dy, Real* dz, Real* gx, Real* gy, Real* gz) {
#pragma omp simd
  for (int i = 0; i < n + 2; ++i) {
    const Real low = p00[i] + p01[i], high = p10[i] + p11[i];
    sum[i] = low + high;
    dy[i] = high - low;
    dz[i] = (p01[i] + p11[i]) - (p00[i] + p10[i]);
  }
#pragma omp simd
  for (int i = 0; i <= n; ++i) {
    gx[i] = w[i] * (sum[i + 1] - sum[i]);
    gy[i] = w[i] * (dy[i + 1] + dy[i]);
    gz[i] = w[i] * (dz[i + 1] + dz[i]);
  }
}

// y = b + D g along one row of n cells from the rows of nodes at its four edges (lower and upper plane, j and j + 1).
struct EdgeRows {
  const Real *low0, *low1, *high0, *high1;
};
EFSI_KERNEL void divergence_row(int n, const EdgeRows& x, const EdgeRows& y, const EdgeRows& z, const Real* b,
                                Real sign, Real* fx, Real* fyz, Real* out) {
#pragma omp simd
  for (int i = 0; i <= n; ++i) {
    fx[i] = (x.low0[i] + x.low1[i]) + (x.high0[i] + x.high1[i]);
    fyz[i] =
        ((y.low1[i] - y.low0[i]) + (y.high1[i] - y.high0[i])) + ((z.high0[i] - z.low0[i]) + (z.high1[i] - z.low1[i]));
  }
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = b[i] + sign * ((fx[i + 1] - fx[i]) + (fyz[i + 1] + fyz[i]));
}

void node_row(const PressureLevel& level, const Real* p, int j, int k, RowScratch& s, Real* gx, Real* gy, Real* gz) {
  const Grid& g = level.grid;
  const int n = g.cells[0];
  gradient_row(n, p + g.padded(-1, j - 1, k - 1), p + g.padded(-1, j, k - 1), p + g.padded(-1, j - 1, k),
               p + g.padded(-1, j, k), level.mobility.data() + g.node(0, j, k), s.sum.data(), s.dy.data(), s.dz.data(),
               gx, gy, gz);
  // Walls: whole rows on the y and z faces, the ends of all others.
  const std::uint8_t* fixed = level.fixed.data() + g.node(0, j, k);
  const bool face = j == 0 || k == 0 || j == g.cells[1] || k == g.cells[2];
  for (int i = 0; i <= n; i += face ? 1 : n) {
    if (fixed[i] & 1u) gx[i] = 0;
    if (fixed[i] & 2u) gy[i] = 0;
    if (fixed[i] & 4u) gz[i] = 0;
  }
}

// The three components of g on one plane of nodes.
struct NodePlane {
  std::vector<Real> x, y, z;
  explicit NodePlane(const Grid& g) {
    for (auto* v : {&x, &y, &z}) v->resize(static_cast<std::size_t>((g.cells[0] + 1) * (g.cells[1] + 1)));
  }
};

void fill_plane(const PressureLevel& level, const Real* p, int k, RowScratch& scratch, NodePlane& plane) {
  const auto row = static_cast<std::size_t>(level.grid.cells[0] + 1);
  for (int j = 0; j <= level.grid.cells[1]; ++j) {
    const std::size_t at = row * static_cast<std::size_t>(j);
    node_row(level, p, j, k, scratch, &plane.x[at], &plane.y[at], &plane.z[at]);
  }
}

// b + sign D g for one plane of cells between two planes of nodes; consume(first padded cell of a row, values).
template <class Consume>
void cell_plane(const PressureLevel& level, int k, const NodePlane& low, const NodePlane& high, const Real* b,
                Real sign, RowScratch& s, const Consume& consume) {
  const Grid& g = level.grid;
  const auto row = static_cast<std::size_t>(g.cells[0] + 1);
  for (int j = 0; j < g.cells[1]; ++j) {
    const std::size_t j0 = row * static_cast<std::size_t>(j), j1 = j0 + row;
    const auto edges = [&](const std::vector<Real>& lower, const std::vector<Real>& upper) {
      return EdgeRows{&lower[j0], &lower[j1], &upper[j0], &upper[j1]};
    };
    const std::size_t cells = g.padded(0, j, k);
    divergence_row(g.cells[0], edges(low.x, high.x), edges(low.y, high.y), edges(low.z, high.z),
                   b ? b + cells : s.zero.data(), sign, s.fx.data(), s.fyz.data(), s.out.data());
    consume(cells, s.out.data());
  }
}

// x += weight d r along a row
EFSI_KERNEL void smooth_row(int n, Real weight, const Real* d, const Real* r, Real* x) {
#pragma omp simd
  for (int i = 0; i < n; ++i) x[i] += weight * d[i] * r[i];
}

}  // namespace

void apply_pressure_operator(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& x,
                             std::vector<Real>& y, const std::vector<Real>* b) {
  const Grid& g = level.grid;
  const auto nx = static_cast<std::size_t>(g.cells[0]);
  parallel.for_ranges(g.cells[2], [&](std::int64_t begin, std::int64_t end) {
    RowScratch scratch(g);
    NodePlane low(g), high(g);
    fill_plane(level, x.data(), static_cast<int>(begin), scratch, low);
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
      fill_plane(level, x.data(), k + 1, scratch, high);
      // A x = -D g; b - A x = b + D g.
      cell_plane(level, k, low, high, b ? b->data() : nullptr, b ? Real(1) : Real(-1), scratch,
                 [&](std::size_t cells, const Real* values) {
                   Real* out = y.data() + cells;
                   if (level.active.empty()) {
                     std::copy(values, values + nx, out);
                     return;
                   }
                   const std::uint8_t* active = level.active.data() + cells;
                   for (std::size_t i = 0; i < nx; ++i) out[i] = active[i] ? values[i] : Real(0);
                 });
      std::swap(low, high);
    }
  });
}

void smooth_pressure(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& b, Real weight,
                     std::vector<Real>& x) {
  const Grid& g = level.grid;
  // Cells may be overwritten as soon as the nodes above them are known; where two threads meet, the nodes come first.
  const int ranges = parallel.ranges(g.cells[2]);
  std::vector<NodePlane> seam(static_cast<std::size_t>(ranges + 1), NodePlane(g));
  parallel.for_each(ranges + 1, [&](std::int64_t t) {
    RowScratch scratch(g);
    fill_plane(level, x.data(), static_cast<int>(parallel.range_begin(g.cells[2], t)), scratch,
               seam[static_cast<std::size_t>(t)]);
  });
  parallel.for_each(ranges, [&](std::int64_t t) {
    RowScratch scratch(g);
    const NodePlane& low = seam[static_cast<std::size_t>(t)];
    const int begin = static_cast<int>(parallel.range_begin(g.cells[2], t));
    const int end = static_cast<int>(parallel.range_begin(g.cells[2], t + 1));
    NodePlane current = low, next(g);
    for (int k = begin; k < end; ++k) {
      if (k + 1 < end) fill_plane(level, x.data(), k + 1, scratch, next);
      const NodePlane& high = k + 1 < end ? next : seam[static_cast<std::size_t>(t) + 1];
      cell_plane(level, k, current, high, b.data(), Real(1), scratch, [&](std::size_t cells, const Real* residual) {
        smooth_row(g.cells[0], weight, level.inverse_diagonal.data() + cells, residual, x.data() + cells);
      });
      std::swap(current, next);
    }
  });
}

void compute_pressure_diagonal(const Parallel& parallel, PressureLevel& level) {
  const Grid& g = level.grid;
  level.inverse_diagonal.assign(g.padded_count(), 0);
  // Mobility times the number of free components, per node.
  std::vector<Real> free(g.node_count());
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const unsigned fixed = level.fixed[g.node(i, j, k)];
        const int count = 3 - static_cast<int>((fixed & 1u) + ((fixed >> 1) & 1u) + ((fixed >> 2) & 1u));
        free[g.node(i, j, k)] = level.mobility[g.node(i, j, k)] * static_cast<Real>(count);
      }
  });
  const auto corner = grid::corner_offsets(g);
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.padded(i, j, k);
        if (!level.active.empty() && !level.active[c]) continue;
        Real sum = 0;
        const std::size_t n = g.node(i, j, k);
        for (std::size_t offset : corner) sum += free[n + offset];
        level.inverse_diagonal[c] = sum > 0 ? 1 / sum : Real(0);
      }
  });
}

void compute_divergence(const Parallel& parallel, const Grid& g, const VectorField& velocity,
                        std::vector<Real>& divergence) {
  const auto o = grid::corner_offsets(g);
  const Real scale = static_cast<Real>(0.25 / g.h);
  const Real *vx = velocity.c[0].data(), *vy = velocity.c[1].data(), *vz = velocity.c[2].data();
  divergence.resize(g.padded_count());
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j) {
      const std::size_t n0 = g.node(0, j, k);
      Real* out = divergence.data() + g.padded(0, j, k);
      const Real *x = vx + n0, *y = vy + n0, *z = vz + n0;
#pragma omp simd
      for (int i = 0; i < g.cells[0]; ++i) {
        const Real *xi = x + i, *yi = y + i, *zi = z + i;
        const Real dx =
            ((xi[o[1]] - xi[o[0]]) + (xi[o[3]] - xi[o[2]])) + ((xi[o[5]] - xi[o[4]]) + (xi[o[7]] - xi[o[6]]));
        const Real dy =
            ((yi[o[2]] - yi[o[0]]) + (yi[o[3]] - yi[o[1]])) + ((yi[o[6]] - yi[o[4]]) + (yi[o[7]] - yi[o[5]]));
        const Real dz =
            ((zi[o[4]] - zi[o[0]]) + (zi[o[5]] - zi[o[1]])) + ((zi[o[6]] - zi[o[2]]) + (zi[o[7]] - zi[o[3]]));
        out[i] = scale * (dx + dy + dz);
      }
    }
  });
}

Vec3 pressure_impulse(const Grid& g, const std::vector<Real>& q, int i, int j, int k) {
  const Real area = static_cast<Real>(g.h * g.h / 4.0);
  Vec3 sum = Vec3::Zero();
  for (const auto& corner : grid::kCorner) {
    const Real p = q[g.padded(i - corner[0], j - corner[1], k - corner[2])];
    for (int a = 0; a < 3; ++a) sum[a] += corner[a] ? p : -p;
  }
  return area * sum;
}

void subtract_pressure_gradient(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& q,
                                VectorField& velocity) {
  const Grid& g = level.grid;
  const auto nx = static_cast<std::size_t>(g.cells[0] + 1);
  const Real scale = static_cast<Real>(4.0 / (g.h * g.h));  // mobility holds (h^2/4)^2, a velocity needs h^2/4
  parallel.for_ranges(g.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    RowScratch scratch(g);
    std::vector<Real> gx(nx), gy(nx), gz(nx);
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j <= g.cells[1]; ++j) {
        node_row(level, q.data(), j, k, scratch, gx.data(), gy.data(), gz.data());
        const std::size_t n = g.node(0, j, k);
        for (std::size_t i = 0; i < nx; ++i) {
          velocity.c[0][n + i] += scale * gx[i];
          velocity.c[1][n + i] += scale * gy[i];
          velocity.c[2][n + i] += scale * gz[i];
        }
      }
  });
}

}  // namespace efsi::system
