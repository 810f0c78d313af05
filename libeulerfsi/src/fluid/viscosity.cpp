#include "fluid/viscosity.hpp"

#include <algorithm>
#include <array>

#include "base/kernel.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"

namespace efsi::fluid {

using grid::Grid;

namespace {

constexpr double kTolerance = 3e-4;  // of what a step changes
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

// work.inverse_diagonal: of M + scale K + S where something moves, 0 elsewhere.
void set_diagonal(const Parallel& parallel, const Grid& g, const ViscousStep& step, Real scale,
                  ViscousWorkspace& work) {
  const std::vector<std::uint8_t>&fixed = step.fixed, &solid = step.solid;
  const SolidResponse* solids = step.solids;
  constexpr Real kDiagonal = Real(1.0 / 3.0 + 1.0 / 16.0);  // of K in a cell
  const std::size_t field = 3 * g.node_count();
  work.inverse_diagonal.assign(field + (solids ? solids->mass.size() : 0), 0);
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
        const Real own = work.mass[n] + scale * kDiagonal * static_cast<Real>(cells);
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t e = entry(g, c, n);
          if (!(fixed[n] & (1u << c))) work.inverse_diagonal[e] = 1 / (own + (solids ? solids->diagonal[e] : Real(0)));
        }
      }
  });
  for (std::size_t e = field; e < work.inverse_diagonal.size(); ++e)
    work.inverse_diagonal[e] = 1 / (solids->mass[e - field] + solids->diagonal[e]);
}

// y = 0 where nothing moves, mass x + scale y elsewhere.
EFSI_KERNEL void finish_row(std::int64_t n, const Real* inverse_diagonal, const Real* mass, Real scale, const Real* x,
                            Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] = inverse_diagonal[i] > 0 ? mass[i] * x[i] + scale * y[i] : Real(0);
}

// (M + scale K + S) x = b on the entries that move.
class ViscousSystem {
 public:
  ViscousSystem(const Parallel& parallel, const Grid& g, const ViscousStep& step, ViscousWorkspace& work)
      : parallel_(parallel), g_(g), step_(step), work_(work) {}

  void set_scale(double scale) {
    scale_ = static_cast<Real>(scale);
    set_diagonal(parallel_, g_, step_, scale_, work_);
  }
  std::size_t entries() const { return work_.inverse_diagonal.size(); }
  bool moves(std::size_t e) const { return work_.inverse_diagonal[e] > 0; }
  // K's part of an entry of K x.
  Real viscous(const std::vector<Real>& kx, std::size_t e) const {
    return e < 3 * g_.node_count() ? scale_ * kx[e] : Real(0);
  }

  // Calls body(entry).
  template <class Body>
  void for_entries(const Body& body) const {
    parallel_.for_each(static_cast<std::int64_t>(entries()),
                       [&](std::int64_t e) { body(static_cast<std::size_t>(e)); });
  }
  // Calls body(component, node, entry).
  template <class Body>
  void for_field(const Body& body) const {
    for (std::size_t c = 0; c < 3; ++c)
      parallel_.for_each(static_cast<std::int64_t>(g_.node_count()), [&](std::int64_t n) {
        body(c, static_cast<std::size_t>(n), entry(g_, c, static_cast<std::size_t>(n)));
      });
  }

  // y = K x of the field, whose copies are those of their originals.
  void multiply_viscosity(const std::vector<Real>& x, std::vector<Real>& y) const {
    const bool periodic = g_.periodic[0] || g_.periodic[1] || g_.periodic[2];
    if (periodic) {
      work_.whole = x;
      fill_copies(g_, work_.whole);
    }
    viscous_force(parallel_, g_, step_.solid, periodic ? work_.whole : x, y);
    if (periodic) gather_copies(g_, y);
  }

  // stats: of all solves so far.
  void solve(const std::vector<Real>& b, std::vector<Real>& x, linalg::SolveStats& stats) const {
    linalg::SolveOptions options;
    options.tolerance = kTolerance;
    options.max_iterations = kMostIterations;
    const auto apply = [&](const std::vector<Real>& from, std::vector<Real>& to) { multiply(from, to); };
    const auto precondition = [&](const std::vector<Real>& r, std::vector<Real>& z) {
      linalg::multiply(parallel_, z, work_.inverse_diagonal, r);
      if (!step_.solids) return;
      step_.solids->correct(r, z);
      mask(z);
    };
    const linalg::SolveStats part = linalg::pcg(parallel_, apply, precondition, b, x, options, work_.pcg);
    stats.iterations += part.iterations;
    stats.converged = stats.converged && part.converged;
  }

 private:
  void multiply(const std::vector<Real>& x, std::vector<Real>& y) const {
    multiply_viscosity(x, y);
    const std::size_t nodes = g_.node_count(), field = 3 * nodes;
    for (std::size_t c = 0; c < 3; ++c)
      parallel_.for_ranges(static_cast<std::int64_t>(nodes), [&](std::int64_t begin, std::int64_t end) {
        const auto first = c * nodes + static_cast<std::size_t>(begin);
        finish_row(end - begin, work_.inverse_diagonal.data() + first, work_.mass.data() + begin, scale_,
                   x.data() + first, y.data() + first);
      });
    if (!step_.solids) return;
    for (std::size_t e = field; e < entries(); ++e) y[e] = step_.solids->mass[e - field] * x[e];
    step_.solids->add(x, y);
    mask(y);
  }
  void mask(std::vector<Real>& y) const {
    for_entries([&](std::size_t e) {
      if (!moves(e)) y[e] = 0;
    });
  }

  const Parallel& parallel_;
  const Grid& g_;
  const ViscousStep& step_;
  ViscousWorkspace& work_;
  Real scale_ = 0;
};

// work.b = r - scale K v, v the velocity before the forces, of what is given the velocity; work.forces: what they
// change.
void set_right_side(const Grid& g, const ViscousStep& step, const grid::VectorField& velocity,
                    const ViscousSystem& system, ViscousWorkspace& work) {
  const std::size_t nodes = g.node_count();
  work.x.assign(system.entries(), 0), work.forces.assign(system.entries(), 0);
  system.for_field([&](std::size_t c, std::size_t n, std::size_t e) {
    work.x[e] = system.moves(e) ? step.before.c[c][n] : velocity.c[c][n];
    work.forces[e] = velocity.c[c][n] - work.x[e];
  });
  system.multiply_viscosity(work.x, work.b);
  system.for_entries([&](std::size_t e) {
    const Real internal = step.solids ? step.solids->internal[e] : Real(0);
    const Real forces = e < 3 * nodes ? work.mass[e % nodes] * work.forces[e] : Real(0);
    work.b[e] = system.moves(e) ? internal + forces - system.viscous(work.b, e) : Real(0);
  });
}

// work.x: the change in one step of Euler -> that of second order, 2 (x_1 + x_2) - x with two steps of half the length.
// work.half: x_2. By modes x_1 is between a half and the whole of x: the start of its solve.
void extrapolate(double scale, ViscousSystem& system, ViscousWorkspace& work, linalg::SolveStats& stats) {
  system.set_scale(scale / 2);
  work.half.resize(system.entries()), work.right.resize(system.entries());
  system.for_entries([&](std::size_t e) { work.half[e] = Real(0.75) * work.x[e], work.right[e] = work.b[e] / 2; });
  system.solve(work.right, work.half, stats);
  system.multiply_viscosity(work.half, work.right);
  system.for_entries([&](std::size_t e) {
    work.right[e] = system.moves(e) ? work.b[e] / 2 - system.viscous(work.right, e) : Real(0);
    const Real whole = work.x[e], first = work.half[e];
    work.x[e] = 2 * first - whole;
    work.half[e] = whole - first;
  });
  system.solve(work.right, work.half, stats);
  system.for_entries([&](std::size_t e) { work.x[e] += 2 * work.half[e]; });
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

linalg::SolveStats diffuse(const Parallel& parallel, const Grid& g, const ViscousStep& step,
                           grid::VectorField& velocity, ViscousWorkspace& work) {
  ViscousSystem system(parallel, g, step, work);
  const double scale = step.dt * step.viscosity * g.h;
  system.set_scale(scale);
  set_right_side(g, step, velocity, system, work);
  linalg::fill(parallel, work.x, system.entries(), Real(0));
  linalg::SolveStats stats;
  stats.converged = true;
  system.solve(work.b, work.x, stats);
  extrapolate(scale, system, work, stats);

  if (step.reactions) {  // -scale K (v + 2 x_1 + x_2 - x)
    system.for_field([&](std::size_t c, std::size_t n, std::size_t e) {
      work.half[e] = velocity.c[c][n] - work.forces[e] + work.x[e] - work.half[e];
    });
    system.multiply_viscosity(work.half, work.right);
    linalg::scale(parallel, work.right, -scale);
  }
  if (step.solids) {
    linalg::fill(parallel, work.b, system.entries(), Real(0));
    step.solids->add(work.x, work.b);
  }
  system.for_field([&](std::size_t c, std::size_t n, std::size_t e) {  // the impulse on the rest is M x + S x - r
    if (!system.moves(e)) return;
    const Real response = step.solids ? (work.b[e] - step.solids->internal[e]) / work.mass[n] : Real(0);
    velocity.c[c][n] += work.x[e] + response - work.forces[e];
  });
  grid::fill_copies(g, velocity);
  return stats;
}

}  // namespace efsi::fluid
