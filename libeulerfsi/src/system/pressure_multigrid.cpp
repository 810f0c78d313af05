#include "system/pressure_multigrid.hpp"

#include <algorithm>
#include <array>

#include "base/kernel.hpp"
#include "linalg/reduce.hpp"

namespace efsi::system {
namespace {

// Chebyshev smoothing of degree 3 as three Jacobi steps with the weights of its roots. The symbol of D^-1 A reaches 8/3
// for uniform density; the polynomial is small on [kLargest/kRange, kLargest].
constexpr int kDegree = 3;
constexpr double kLargest = 2.8, kRange = 16.0;
constexpr int kCoarsestCells = 6;            // coarsen while every axis has more cells than this
constexpr std::size_t kSerialCells = 27000;  // a level of no more cells is faster on one thread
constexpr double kUnfocused = 0.5;          // of the tolerance: residual in tiles that are not smoothed
constexpr double kMostFocused = 0.5;         // of all tiles: with more, sweeps of everything are faster
constexpr int kCoarsestIterations = 18;      // smoothing steps on the coarsest level

// The roots lie at center + radius cos(pi/6, pi/2, 5 pi/6); written out, because library cosines differ between
// machines.
constexpr double kCenter = 0.5 * (kLargest + kLargest / kRange), kRadius = 0.5 * (kLargest - kLargest / kRange);
constexpr double kCosine = 0.86602540378443865;
constexpr Real kWeights[kDegree] = {static_cast<Real>(1.0 / (kCenter + kRadius * kCosine)),
                                    static_cast<Real>(1.0 / kCenter),
                                    static_cast<Real>(1.0 / (kCenter - kRadius * kCosine))};

// Where an axis of the coarse grid reads fine cells (restriction, 1/4 3/4 3/4 1/4) with walls folded in.
struct AxisTable {
  std::vector<std::array<int, 4>> index;
  std::vector<std::array<Real, 4>> weight;
};

AxisTable restriction_table(int fine, int coarse, grid::Wall lower, grid::Wall upper, bool periodic) {
  AxisTable table;
  table.index.resize(static_cast<std::size_t>(coarse));
  table.weight.resize(static_cast<std::size_t>(coarse));
  for (int c = 0; c < coarse; ++c)
    for (int t = 0; t < 4; ++t) {
      int f = 2 * c - 1 + t;
      Real w = t == 0 || t == 3 ? Real(0.25) : Real(0.75);
      if (periodic) {
        f = (f + fine) % fine;
      } else if (f < 0) {  // the fine cell at the wall gave this share to the ghost beyond it
        if (lower == grid::Wall::kOpen) w = 0;
        f = 0;
      } else if (f >= fine) {
        if (upper == grid::Wall::kOpen || fine % 2 != 0) w = 0;
        f = fine - 1;
      }
      table.index[static_cast<std::size_t>(c)][static_cast<std::size_t>(t)] = f;
      table.weight[static_cast<std::size_t>(c)][static_cast<std::size_t>(t)] = w;
    }
  return table;
}

std::array<AxisTable, 3> restriction_tables(const Grid& fine, const Grid& coarse, const Walls& walls) {
  std::array<AxisTable, 3> tables;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    tables[s] = restriction_table(fine.cells[s], coarse.cells[s], walls.lower(a), walls.upper(a), fine.periodic[s]);
  }
  return tables;
}

// target += w source
EFSI_KERNEL void add_row(int n, Real w, const Real* source, Real* target) {
#pragma omp simd
  for (int i = 0; i < n; ++i) target[i] += w * source[i];
}

void restrict_residual(const Parallel& parallel, const PressureLevel& fine, const std::vector<Real>& r,
                       const PressureLevel& coarse, std::vector<Real>& b) {
  const Grid &gf = fine.grid, &gc = coarse.grid;
  const auto tables = restriction_tables(gf, gc, fine.walls);
  const int nf = gf.cells[0];
  parallel.for_ranges(gc.cells[2], [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> row(static_cast<std::size_t>(nf));
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j < gc.cells[1]; ++j) {
        std::fill(row.begin(), row.end(), Real(0));
        for (std::size_t tk = 0; tk < 4; ++tk)
          for (std::size_t tj = 0; tj < 4; ++tj) {
            const auto ks = static_cast<std::size_t>(k), js = static_cast<std::size_t>(j);
            const Real w = tables[2].weight[ks][tk] * tables[1].weight[js][tj];
            if (w == 0) continue;
            const Real* source = r.data() + gf.padded(0, tables[1].index[js][tj], tables[2].index[ks][tk]);
            add_row(nf, w, source, row.data());
          }
        Real* out = b.data() + gc.padded(0, j, k);
        const std::uint8_t* active = coarse.active.empty() ? nullptr : coarse.active.data() + gc.padded(0, j, k);
        for (int i = 0; i < gc.cells[0]; ++i) {
          const auto& index = tables[0].index[static_cast<std::size_t>(i)];
          const auto& weight = tables[0].weight[static_cast<std::size_t>(i)];
          Real sum = 0;
          for (std::size_t t = 0; t < 4; ++t) sum += weight[t] * row[static_cast<std::size_t>(index[t])];
          out[i] = active && !active[i] ? Real(0) : sum;
        }
      }
  });
}

// Coarse neighbours of a fine cell along one axis: nearest (3/4) and next (1/4).
struct Pair {
  int near, far;
  Real far_weight;
};

std::vector<Pair> prolongation_pairs(int fine, int coarse, grid::Wall lower, grid::Wall upper, bool periodic) {
  std::vector<Pair> pairs(static_cast<std::size_t>(fine));
  for (int f = 0; f < fine; ++f) {
    const int near = f / 2;
    int far = f % 2 ? near + 1 : near - 1;
    Real weight = Real(0.25);
    if (periodic) {
      far = (far + coarse) % coarse;
    } else if (far < 0) {
      if (lower == grid::Wall::kOpen) weight = 0;
      far = 0;
    } else if (far >= coarse) {
      if (upper == grid::Wall::kOpen) weight = 0;
      far = coarse - 1;
    }
    pairs[static_cast<std::size_t>(f)] = {near, far, weight};
  }
  return pairs;
}

void prolong_and_add(const Parallel& parallel, const PressureLevel& coarse, const std::vector<Real>& xc,
                     const PressureLevel& fine, std::vector<Real>& x) {
  const Grid &gf = fine.grid, &gc = coarse.grid;
  std::array<std::vector<Pair>, 3> pairs;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    pairs[s] = prolongation_pairs(gf.cells[s], gc.cells[s], fine.walls.lower(a), fine.walls.upper(a), gf.periodic[s]);
  }
  const int nc = gc.cells[0];
  parallel.for_ranges(gf.cells[2], [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> row(static_cast<std::size_t>(nc));
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j < gf.cells[1]; ++j) {
        const Pair pk = pairs[2][static_cast<std::size_t>(k)], pj = pairs[1][static_cast<std::size_t>(j)];
        const Real* nn = xc.data() + gc.padded(0, pj.near, pk.near);
        const Real* fn = xc.data() + gc.padded(0, pj.far, pk.near);
        const Real* nf = xc.data() + gc.padded(0, pj.near, pk.far);
        const Real* ff = xc.data() + gc.padded(0, pj.far, pk.far);
        const Real wj = Real(0.75), wk = Real(0.75), vj = pj.far_weight, vk = pk.far_weight;
        Real* target = row.data();
#pragma omp simd
        for (int i = 0; i < nc; ++i) target[i] = wk * (wj * nn[i] + vj * fn[i]) + vk * (wj * nf[i] + vj * ff[i]);
        Real* out = x.data() + gf.padded(0, j, k);
        const Real* diagonal = fine.inverse_diagonal.data() + gf.padded(0, j, k);
        const auto add = [&](int i) {
          const Pair pi = pairs[0][static_cast<std::size_t>(i)];
          if (diagonal[i] > 0) out[i] += Real(0.75) * target[pi.near] + pi.far_weight * target[pi.far];
        };
        const int n = gf.cells[0];
        add(0);
        // Inside, fine cells 2c - 1 and 2c lie between the coarse cells c - 1 and c.
        for (int c = 1; 2 * c < n; ++c) {
          const Real a = target[c - 1], b = target[c];
          if (diagonal[2 * c - 1] > 0) out[2 * c - 1] += Real(0.75) * a + Real(0.25) * b;
          if (diagonal[2 * c] > 0) out[2 * c] += Real(0.75) * b + Real(0.25) * a;
        }
        if (n > 1 && n % 2 == 0) add(n - 1);
      }
  });
}

// (1/2, 1, 1/2)^3 / 8 average of the nodes around every second node.
void coarsen_specific_volume(const Parallel& parallel, const Grid& fine, const std::vector<Real>& f, const Grid& coarse,
                             std::vector<Real>& c) {
  c.resize(coarse.node_count());
  const auto fold = [&](int axis, int index) {
    const int n = fine.cells[static_cast<std::size_t>(axis)];
    if (fine.periodic[static_cast<std::size_t>(axis)]) return (index + n) % n;
    if (index < 0) return -index;
    return std::min(index, n);
  };
  const auto row = static_cast<std::size_t>(fine.cells[0] + 1);
  parallel.for_ranges(coarse.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> sum(row);
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j <= coarse.cells[1]; ++j) {
        std::fill(sum.begin(), sum.end(), Real(0));
        for (int dk = -1; dk <= 1; ++dk)
          for (int dj = -1; dj <= 1; ++dj) {
            const Real w = Real(0.125) * (dk ? Real(0.5) : Real(1)) * (dj ? Real(0.5) : Real(1));
            add_row(static_cast<int>(row), w, f.data() + fine.node(0, fold(1, 2 * j + dj), fold(2, 2 * k + dk)),
                    sum.data());
          }
        Real* out = c.data() + coarse.node(0, j, k);
        const auto at = [&](int i) { return sum[static_cast<std::size_t>(fold(0, i))]; };
        for (int i = 0; i <= coarse.cells[0]; ++i) out[i] = at(2 * i) + Real(0.5) * (at(2 * i - 1) + at(2 * i + 1));
      }
  });
}

// mobility = (h^2/4)^2 / m with m = density h^3 (adjacent cells) / 8.
void set_mobility(const Parallel& parallel, const std::vector<Real>& specific_volume, PressureLevel& level) {
  const Grid& g = level.grid;
  level.mobility.resize(g.node_count());
  const auto cells = [&](std::size_t axis, int index) {  // adjacent along one axis
    return g.periodic[axis] || (index > 0 && index < g.cells[axis]) ? 2.0 : 1.0;
  };
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk), n = g.cells[0];
    for (int j = 0; j <= g.cells[1]; ++j) {
      const double scale = g.h / 2.0 / (cells(1, j) * cells(2, k));
      const Real inner = static_cast<Real>(scale / 2.0), end = static_cast<Real>(scale / cells(0, 0));
      const Real* volume = specific_volume.data() + g.node(0, j, k);
      Real* out = level.mobility.data() + g.node(0, j, k);
#pragma omp simd
      for (int i = 1; i < n; ++i) out[i] = inner * volume[i];
      out[0] = end * volume[0];
      out[n] = end * volume[n];
    }
  });
}

}  // namespace

void PressureMultigrid::build(const Parallel& parallel, const Grid& g, const Walls& walls,
                              const std::vector<std::uint8_t>& fixed, const std::vector<Real>& specific_volume,
                              std::vector<std::uint8_t> active, const SlipNodes* slip) {
  slip_ = slip;
  std::size_t count = 0;
  const auto prepare = [&](const Grid& level_grid, const Walls& level_walls) -> Level& {
    if (levels_.size() <= count) levels_.emplace_back();
    Level& level = levels_[count++];
    if (level.op.grid.cells != level_grid.cells || level.residual.empty()) {
      for (auto* field : {&level.x, &level.b, &level.residual}) field->assign(level_grid.padded_count(), 0);
      level.op.fixed = grid::fixed_by_walls(level_grid, level_walls);
    }
    level.op.grid = level_grid;
    level.op.walls = level_walls;
    return level;
  };
  {
    Level& level = prepare(g, walls);
    level.op.fixed = fixed;
    level.specific_volume = specific_volume;
    level.op.active = std::move(active);
  }
  while (true) {
    const Grid fine = levels_[count - 1].op.grid;
    bool coarsen = true;
    for (std::size_t a = 0; a < 3; ++a)
      coarsen = coarsen && fine.cells[a] > kCoarsestCells && !(fine.periodic[a] && fine.cells[a] % 2 != 0);
    if (!coarsen) break;
    Grid coarse = fine;
    for (std::size_t a = 0; a < 3; ++a) coarse.cells[a] = (fine.cells[a] + 1) / 2;
    coarse.h = 2.0 * fine.h;
    Walls coarse_walls = walls;
    for (auto& face : coarse_walls.face)
      if (face == grid::Wall::kNoSlip) face = grid::Wall::kSlip;
    Level& level = prepare(coarse, coarse_walls);
    const Level& parent = levels_[count - 2];
    coarsen_specific_volume(parallel, fine, parent.specific_volume, coarse, level.specific_volume);
    level.op.active.clear();
    if (!parent.op.active.empty()) {  // a coarse cell has an equation when one of its children has
      level.op.active.assign(coarse.padded_count(), 0);
      for (int k = 0; k < fine.cells[2]; ++k)
        for (int j = 0; j < fine.cells[1]; ++j)
          for (int i = 0; i < fine.cells[0]; ++i)
            if (parent.op.active[fine.padded(i, j, k)]) level.op.active[coarse.padded(i / 2, j / 2, k / 2)] = 1;
    }
  }
  levels_.resize(count);
  for (Level& level : levels_) {
    set_mobility(parallel, level.specific_volume, level.op);
    compute_pressure_diagonal(parallel, level.op);
  }
  if (slip_ && !slip_->empty()) {
    std::vector<Real>& d = levels_[0].op.inverse_diagonal;
    slip_->for_diagonal_terms(parallel, [&](std::size_t c, Real value) {
      if (d[c] > 0) d[c] = 1 / (1 / d[c] + value);
    });
  }
}

void PressureMultigrid::apply(const Parallel& parallel, std::vector<Real>& x, std::vector<Real>& y) const {
  grid::fill_ghosts(finest().grid, x, Real(0));
  apply_pressure_operator(parallel, finest(), x, y);
  add_slip(parallel, x, Real(1), y);
}

void PressureMultigrid::smooth(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& b,
                               std::vector<Real>& x, int step) const {
  grid::fill_periodic_ghosts(level.grid, x);
  const Real weight = kWeights[step % kDegree];
  const bool slips = slip_ && &level == &finest();
  std::vector<SlipNodes::Pair> excess;  // of x before the step
  if (slips) excess = slip_->excess(parallel, x);
  smooth_pressure(parallel, level, b, weight, x);
  if (slips)
    slip_->for_terms(parallel, excess,
                     [&](std::size_t c, Real value) { x[c] -= weight * level.inverse_diagonal[c] * value; });
}

void PressureMultigrid::add_slip(const Parallel& parallel, const std::vector<Real>& x, Real sign,
                                 std::vector<Real>& y) const {
  if (!slip_) return;
  const auto& active = finest().active;
  slip_->for_terms(parallel, slip_->excess(parallel, x), [&](std::size_t c, Real value) {
    if (active.empty() || active[c]) y[c] += sign * value;
  });
}

void PressureMultigrid::focus(const Parallel& parallel, const std::vector<Real>& r, double b, double tolerance) {
  const Grid& g = finest().grid;
  grid::TileMask mask(g.cells);
  std::vector<std::pair<double, std::int64_t>> tiles(static_cast<std::size_t>(mask.count()));  // |r|^2 in each
  parallel.for_each(mask.count(), [&](std::int64_t t) {
    Vec3i begin, end;
    mask.range(t, begin, end);
    double sum = 0.0;
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j)
        for (int i = begin[0]; i < end[0]; ++i) {
          const double value = static_cast<double>(r[g.padded(i, j, k)]);
          sum += value * value;
        }
    tiles[static_cast<std::size_t>(t)] = {sum, t};
  });
  std::sort(tiles.begin(), tiles.end());
  double left = 0.0;
  for (const auto& [sum, t] : tiles) {
    left += sum;
    mask.set(t, !(left <= kUnfocused * kUnfocused * tolerance * tolerance * b * b));
  }
  set_focus(mask);
}

void PressureMultigrid::focus(const std::vector<std::size_t>& cells) {
  const Grid& g = finest().grid;
  grid::TileMask mask(g.cells);
  const auto tile = [](std::size_t padded) { return (static_cast<int>(padded) - 1) / grid::kTileSize; };
  const std::size_t row = g.padded(0, 1, 0) - g.padded(0, 0, 0), plane = g.padded(0, 0, 1) - g.padded(0, 0, 0);
  for (const std::size_t c : cells) mask.set(mask.at({tile(c % row), tile(c % plane / row), tile(c / plane)}), true);
  set_focus(mask);
}

void PressureMultigrid::set_focus(grid::TileMask& mask) {
  const Grid& g = finest().grid;
  widen();
  mask.dilate(g.periodic);
  if (static_cast<double>(mask.active_count()) > kMostFocused * static_cast<double>(mask.count())) return;
  focused_ = mask.boxes();
  mask.dilate(g.periodic);
  reached_ = mask.boxes();
}

// The first step, from zero.
void PressureMultigrid::begin_in_focus(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) {
  parallel.for_ranges(static_cast<std::int64_t>(x.size()), [&](std::int64_t begin, std::int64_t end) {
    std::fill(x.begin() + begin, x.begin() + end, Real(0));
  });
  relax_in_boxes(parallel, finest(), focused_, kWeights[0], b, x);
}

void PressureMultigrid::smooth_in_focus(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x,
                                        int step) {
  Level& level = levels_[0];
  grid::fill_periodic_ghosts(level.op.grid, x);
  residual_in_boxes(parallel, level.op, focused_, b, x, level.residual);
  add_slip(parallel, x, Real(-1), level.residual);
  relax_in_boxes(parallel, level.op, focused_, kWeights[step % kDegree], level.residual, x);
}

void PressureMultigrid::cycle(const Parallel& every, std::size_t l, const std::vector<Real>& b, std::vector<Real>& x) {
  Level& level = levels_[l];
  const Parallel& parallel = level.op.grid.cell_count() <= kSerialCells ? serial_ : every;
  const bool focused = l == 0 && !focused_.empty();
  if (focused)
    begin_in_focus(parallel, b, x);
  else
    linalg::multiply(parallel, x, level.op.inverse_diagonal, b, kWeights[0]);  // the first smoothing step, from zero
  const auto smooth_once = [&](int step) {
    if (focused)
      smooth_in_focus(parallel, b, x, step);
    else
      smooth(parallel, level.op, b, x, step);
  };
  if (l + 1 == levels_.size()) {
    for (int it = 1; it < kCoarsestIterations; ++it) smooth(parallel, level.op, b, x, it);
    return;
  }
  for (int i = 1; i < kDegree; ++i) smooth_once(i);
  Level& coarse = levels_[l + 1];
  grid::fill_periodic_ghosts(level.op.grid, x);
  if (focused) {
    parallel.for_ranges(static_cast<std::int64_t>(b.size()), [&](std::int64_t begin, std::int64_t end) {
      std::copy(b.begin() + begin, b.begin() + end, level.residual.begin() + begin);
    });
    residual_in_boxes(parallel, level.op, reached_, b, x, level.residual);
  } else {
    apply_pressure_operator(parallel, level.op, x, level.residual, &b);
  }
  if (l == 0) add_slip(parallel, x, Real(-1), level.residual);
  restrict_residual(parallel, level.op, level.residual, coarse.op, coarse.b);
  cycle(every, l + 1, coarse.b, coarse.x);
  prolong_and_add(parallel, coarse.op, coarse.x, level.op, x);
  for (int i = kDegree - 1; i >= 0; --i) smooth_once(i);
}

void PressureMultigrid::precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) {
  z.resize(r.size());
  cycle(parallel, 0, r, z);
}

std::size_t PressureMultigrid::bytes() const {
  std::size_t total = 0;
  for (const Level& level : levels_)
    total += (level.x.size() + level.b.size() + level.residual.size() + level.specific_volume.size() +
              level.op.mobility.size() + level.op.inverse_diagonal.size()) *
                 sizeof(Real) +
             level.op.active.size();
  return total;
}

}  // namespace efsi::system
