#include "fluid/viscosity.hpp"

#include <algorithm>
#include <array>

#include "base/kernel.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"

namespace efsi::fluid {

using grid::Grid;

namespace {

constexpr double kTolerance = 1e-3;  // of what a step changes
constexpr int kMostIterations = 400;

// One row of cells: the four rows of nodes around it by component, (y, z) = (0, 0), (1, 0), (0, 1), (1, 1), and how
// much of each cell is fluid.
struct CellRow {
  const Real* v[3][4];
  const Real* share;
};
// What the cells give the two rows of nodes on one side along z, at y = 0 and 1: to the lower and to the upper node
// along x, by component.
struct Given {
  Real* value[2][2][3];
};

// Laplacian of a trilinear cube: 1/3 on the diagonal, 0 along edges, -1/12 across faces and through the middle.
// Corner (x, y, z): what it gets is 5/12 of itself and 1/12 of its three neighbours less 1/12 of all eight.
EFSI_KERNEL void force_row(int n, const CellRow& cells, int upper, const Given& given) {
  constexpr Real kOwn = Real(5.0 / 12.0), kShare = Real(1.0 / 12.0), kMean = Real(1.0 / 16.0);
  const CellRow row = cells;
  const Given out = given;
  const int here = 2 * upper, there = 2 - here;  // rows on that side along z and on the other
  const Real side_z = upper ? Real(1) : Real(-1);
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    Real gradient[3][3];  // four times the mean of d v_c / d x_a: [c][a]
    for (int c = 0; c < 3; ++c) {
      const Real *p = row.v[c][0] + i, *q = row.v[c][1] + i, *r = row.v[c][2] + i, *s = row.v[c][3] + i;
      gradient[c][0] = ((p[1] - p[0]) + (q[1] - q[0])) + ((r[1] - r[0]) + (s[1] - s[0]));
      gradient[c][1] = ((q[0] - p[0]) + (q[1] - p[1])) + ((s[0] - r[0]) + (s[1] - r[1]));
      gradient[c][2] = ((r[0] - p[0]) + (r[1] - p[1])) + ((s[0] - q[0]) + (s[1] - q[1]));
    }
    const Real part = row.share[i];
    for (int c = 0; c < 3; ++c) {
      const Real *a = row.v[c][here] + i, *b = row.v[c][here + 1] + i, *d = row.v[c][there] + i,
                 *e = row.v[c][there + 1] + i;
      const Real all = ((a[0] + a[1]) + (b[0] + b[1])) + ((d[0] + d[1]) + (e[0] + e[1]));
      // sum over j of side_j d v_j / d x_c
      const Real along_z = side_z * gradient[2][c], plus = gradient[0][c] + gradient[1][c],
                 minus = gradient[0][c] - gradient[1][c];
      out.value[0][0][c][i] = part * (kOwn * a[0] + kShare * (((a[1] + b[0]) + d[0]) - all) + kMean * (along_z - plus));
      out.value[0][1][c][i] =
          part * (kOwn * a[1] + kShare * (((a[0] + b[1]) + d[1]) - all) + kMean * (along_z + minus));
      out.value[1][0][c][i] =
          part * (kOwn * b[0] + kShare * (((b[1] + a[0]) + e[0]) - all) + kMean * (along_z - minus));
      out.value[1][1][c][i] = part * (kOwn * b[1] + kShare * (((b[0] + a[1]) + e[1]) - all) + kMean * (along_z + plus));
    }
  }
}

EFSI_KERNEL void add_to(int n, const Real* a, Real* y) {
#pragma omp simd
  for (int i = 0; i < n; ++i) y[i] += a[i];
}

// Entries of whole fields: component c of node m at c nodes + m.
std::size_t entry(const Grid& g, std::size_t c, std::size_t node) { return c * g.node_count() + node; }

// Copies take the values of their originals; x, then y, then z, so that those of edges and corners are right.
void fill_copies(const Grid& g, std::vector<Real>& x) {
  for (std::size_t a = 0; a < 3; ++a)
    grid::for_copies(g, a, [&](std::size_t node, std::size_t copy) {
      for (std::size_t c = 0; c < 3; ++c) x[entry(g, c, copy)] = x[entry(g, c, node)];
    });
}

// Originals get what their copies have, which are left with nothing.
void gather_copies(const Grid& g, std::vector<Real>& y) {
  for (std::size_t a = 0; a < 3; ++a)
    grid::for_copies(g, a, [&](std::size_t node, std::size_t copy) {
      for (std::size_t c = 0; c < 3; ++c) {
        y[entry(g, c, node)] += y[entry(g, c, copy)];
        y[entry(g, c, copy)] = 0;
      }
    });
}

bool is_copy(const Grid& g, std::size_t node) {
  const Vec3i at = g.node_place(node);
  for (std::size_t a = 0; a < 3; ++a)
    if (g.periodic[a] && at[a] == g.cells[a]) return true;
  return false;
}

// work.inverse_diagonal: of M + scale K where something moves, 0 elsewhere.
void set_diagonal(const Parallel& parallel, const Grid& g, const std::vector<std::uint8_t>& fixed,
                  const std::vector<std::uint8_t>& solid, Real scale, ViscousWorkspace& work) {
  constexpr Real kDiagonal = Real(1.0 / 3.0 + 1.0 / 16.0);  // of K in a cell
  work.inverse_diagonal.assign(3 * g.node_count(), 0);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (is_copy(g, n) || !(work.mass[n] > 0)) continue;
        int cells = 0;
        for (const auto& corner : grid::kCorner) {
          Vec3i q{i - corner[0], j - corner[1], k - corner[2]};
          bool inside = true;
          for (std::size_t a = 0; a < 3; ++a) {
            if (g.periodic[a]) q[a] = (q[a] + g.cells[a]) % g.cells[a];
            inside = inside && q[a] >= 0 && q[a] < g.cells[a];
          }
          cells += inside && (solid.empty() || !solid[g.padded(q[0], q[1], q[2])]);
        }
        const Real inverse = 1 / (work.mass[n] + scale * kDiagonal * static_cast<Real>(cells));
        for (std::size_t c = 0; c < 3; ++c)
          if (!(fixed[n] & (1u << c))) work.inverse_diagonal[entry(g, c, n)] = inverse;
      }
  });
}

// y = 0 where nothing moves, mass x + scale y elsewhere.
EFSI_KERNEL void finish_row(std::int64_t n, const Real* inverse_diagonal, const Real* mass, Real scale, const Real* x,
                            Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] = inverse_diagonal[i] > 0 ? mass[i] * x[i] + scale * y[i] : Real(0);
}

}  // namespace

void viscous_force(const Parallel& parallel, const Grid& g, const std::vector<std::uint8_t>& solid,
                   const std::vector<Real>& x, std::vector<Real>& y) {
  y.resize(x.size());
  const int n = g.cells[0];
  const auto width = static_cast<std::size_t>(n);
  parallel.for_ranges(g.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> given(12 * width), share(width, Real(1));
    Given out;
    for (std::size_t r = 0; r < 12; ++r) out.value[r / 6][r / 3 % 2][r % 3] = given.data() + r * width;
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
      for (std::size_t c = 0; c < 3; ++c)
        std::fill_n(y.data() + entry(g, c, g.node(0, 0, k)), g.node_stride(2), Real(0));
      for (const int upper : {1, 0}) {  // the cells below the plane of nodes, then those above
        const int layer = k - upper;
        if (layer < 0 || layer >= g.cells[2]) continue;
        for (int j = 0; j < g.cells[1]; ++j) {
          if (!solid.empty()) {
            const std::uint8_t* cell = solid.data() + g.padded(0, j, layer);
            if (std::all_of(cell, cell + width, [](std::uint8_t s) { return s != 0; })) continue;
            std::transform(cell, cell + width, share.begin(), [](std::uint8_t s) { return s ? Real(0) : Real(1); });
          }
          CellRow row{{}, share.data()};
          for (std::size_t c = 0; c < 3; ++c)
            for (int r = 0; r < 4; ++r) row.v[c][r] = x.data() + entry(g, c, g.node(0, j + (r & 1), layer + (r >> 1)));
          force_row(n, row, upper, out);
          for (int side = 0; side < 2; ++side)
            for (std::size_t c = 0; c < 3; ++c) {
              Real* to = y.data() + entry(g, c, g.node(0, j + side, k));
              add_to(n, out.value[side][0][c], to);
              add_to(n, out.value[side][1][c], to + 1);
            }
        }
      }
    }
  });
}

linalg::SolveStats diffuse(const Parallel& parallel, const Grid& g, const std::vector<std::uint8_t>& fixed,
                           const std::vector<std::uint8_t>& solid, double viscosity, double dt,
                           grid::VectorField& velocity, ViscousWorkspace& work) {
  const std::size_t nodes = g.node_count();
  const Real scale = static_cast<Real>(dt * viscosity * g.h);
  set_diagonal(parallel, g, fixed, solid, scale, work);
  // What is solved for is the change: (M + scale K) x = -scale K v.
  work.x.resize(3 * nodes);
  for (std::size_t c = 0; c < 3; ++c)
    std::copy(velocity.c[c].begin(), velocity.c[c].end(), work.x.begin() + static_cast<std::ptrdiff_t>(c * nodes));
  viscous_force(parallel, g, solid, work.x, work.b);
  gather_copies(g, work.b);
  parallel.for_each(static_cast<std::int64_t>(3 * nodes), [&](std::int64_t i) {
    const auto e = static_cast<std::size_t>(i);
    work.b[e] = work.inverse_diagonal[e] > 0 ? -scale * work.b[e] : Real(0);
  });
  linalg::fill(parallel, work.x, 3 * nodes, Real(0));
  const bool periodic = g.periodic[0] || g.periodic[1] || g.periodic[2];
  std::vector<Real> whole;  // with copies
  const auto apply = [&](const std::vector<Real>& x, std::vector<Real>& y) {
    if (periodic) {
      whole = x;
      fill_copies(g, whole);
    }
    viscous_force(parallel, g, solid, periodic ? whole : x, y);
    if (periodic) gather_copies(g, y);
    for (std::size_t c = 0; c < 3; ++c)
      parallel.for_ranges(static_cast<std::int64_t>(nodes), [&](std::int64_t begin, std::int64_t end) {
        const auto first = c * nodes + static_cast<std::size_t>(begin);
        finish_row(end - begin, work.inverse_diagonal.data() + first, work.mass.data() + begin, scale, x.data() + first,
                   y.data() + first);
      });
  };
  const auto jacobi = [&](const std::vector<Real>& r, std::vector<Real>& z) {
    linalg::multiply(parallel, z, work.inverse_diagonal, r);
  };
  linalg::SolveOptions options;
  options.tolerance = kTolerance;
  options.max_iterations = kMostIterations;
  const linalg::SolveStats stats = linalg::pcg(parallel, apply, jacobi, work.b, work.x, options, work.pcg);
  if (periodic) fill_copies(g, work.x);
  for (std::size_t c = 0; c < 3; ++c)
    parallel.for_each(static_cast<std::int64_t>(nodes), [&](std::int64_t n) {
      velocity.c[c][static_cast<std::size_t>(n)] += work.x[c * nodes + static_cast<std::size_t>(n)];
    });
  return stats;
}

}  // namespace efsi::fluid
