#include "system/pressure_transfer.hpp"

#include <algorithm>
#include <array>

#include "base/kernel.hpp"

namespace efsi::system {
namespace {

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

}  // namespace

void restrict_residual(const Parallel& parallel, const PressureGrid& fine, const std::vector<Real>& r,
                       const PressureGrid& coarse, std::vector<Real>& b) {
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

void prolong_and_add(const Parallel& parallel, const PressureGrid& coarse, const std::vector<Real>& xc,
                     const PressureGrid& fine, std::vector<Real>& x) {
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

}  // namespace efsi::system
