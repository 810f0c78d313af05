#include "system/pressure_transfer.hpp"

#include <algorithm>
#include <array>

#include "base/kernel.hpp"

namespace efsi::system {
namespace {

// An even number of cells along an axis is halved: two fine cells lie in a coarse one. Of an odd number every second
// cell stays, from the first to the last: so both ends are alike, and what is its own mirror image is that on all
// levels.

// The pressure of the coarse ghost beyond a wall over that of the cell before it. The finer cell between the wall and
// that cell reads 3/4 and 1/4 of the two: at an open wall, where p = 0, its part by distance, (outer - 1/2) / outer.
Real ghost(grid::Wall wall, double outer) {
  return wall == grid::Wall::kOpen ? static_cast<Real>(1.0 - 2.0 / outer) : Real(1);
}

// Where an axis of the coarse grid reads fine cells (restriction, 1/4 3/4 3/4 1/4, or 1/2 1 1/2 0 of an odd number)
// with walls folded in.
struct AxisTable {
  std::vector<std::array<int, 4>> index;
  std::vector<std::array<Real, 4>> weight;
};

AxisTable restriction_table(int fine, int coarse, grid::Wall lower, grid::Wall upper, bool periodic, double outer) {
  AxisTable table;
  table.index.resize(static_cast<std::size_t>(coarse));
  table.weight.resize(static_cast<std::size_t>(coarse));
  for (int c = 0; c < coarse; ++c)
    for (int t = 0; t < 4; ++t) {
      int f = 2 * c - 1 + t;
      const bool odd = !periodic && fine % 2 != 0;
      Real w = odd ? (t == 1 ? Real(1) : (t == 3 ? Real(0) : Real(0.5))) : (t == 0 || t == 3 ? Real(0.25) : Real(0.75));
      if (periodic) {
        f = (f + fine) % fine;
      } else if (f < 0) {  // the fine cell at the wall gave this share to the ghost beyond it
        w *= odd ? Real(0) : ghost(lower, outer);
        f = 0;
      } else if (f >= fine) {
        w *= odd ? Real(0) : ghost(upper, outer);
        f = fine - 1;
      }
      table.index[static_cast<std::size_t>(c)][static_cast<std::size_t>(t)] = f;
      table.weight[static_cast<std::size_t>(c)][static_cast<std::size_t>(t)] = w;
    }
  return table;
}

std::array<AxisTable, 3> restriction_tables(const PressureGrid& fine, const Grid& coarse) {
  const int slab = grid::slab_axis(fine.grid, fine.walls);
  std::array<AxisTable, 3> tables;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    tables[s] = restriction_table(fine.grid.cells[s], coarse.cells[s], fine.walls.lower(a), fine.walls.upper(a),
                                  fine.grid.periodic[s], fine.outer[s]);
    // A slab's coarse cell is treated as a cube, twice as thick as the fine cells that it represents.
    if (a == slab) tables[s].weight[0] = {0, 2, 0, 0};
  }
  return tables;
}

// target += w source
EFSI_KERNEL void add_row(int n, Real w, const Real* source, Real* target) {
#pragma omp simd
  for (int i = 0; i < n; ++i) target[i] += w * source[i];
}

// Coarse neighbours of a fine cell along one axis: nearest (3/4) and next (1/4); of an odd number of cells the same
// cell (1), or both beside it (1/2 each).
struct Pair {
  int near, far;
  Real near_weight, far_weight;
};

std::vector<Pair> prolongation_pairs(int fine, int coarse, grid::Wall lower, grid::Wall upper, bool periodic,
                                     double outer) {
  std::vector<Pair> pairs(static_cast<std::size_t>(fine));
  for (int f = 0; f < fine; ++f) {
    const int near = f / 2;
    int far = f % 2 ? near + 1 : near - 1;
    Real weight = Real(0.25);
    if (!periodic && fine % 2 != 0) {
      const Real half = Real(0.5);
      pairs[static_cast<std::size_t>(f)] = f % 2 ? Pair{near, far, half, half} : Pair{near, near, 1, 0};
      continue;
    }
    if (periodic) {
      far = (far + coarse) % coarse;
    } else if (far < 0) {
      weight *= ghost(lower, outer);
      far = 0;
    } else if (far >= coarse) {
      weight *= ghost(upper, outer);
      far = coarse - 1;
    }
    pairs[static_cast<std::size_t>(f)] = {near, far, Real(0.75), weight};
  }
  return pairs;
}

}  // namespace

void restrict_residual(const Parallel& parallel, const PressureGrid& fine, const std::vector<Real>& r,
                       const PressureGrid& coarse, std::vector<Real>& b) {
  const Grid &gf = fine.grid, &gc = coarse.grid;
  const auto tables = restriction_tables(fine, gc);
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
  // Along each axis the two coarse cells of a fine one.
  std::array<std::vector<Pair>, 3> pairs;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    pairs[s] = prolongation_pairs(gf.cells[s], gc.cells[s], fine.walls.lower(a), fine.walls.upper(a), gf.periodic[s],
                                  fine.outer[s]);
  }
  const int nc = gc.cells[0];
  const bool odd_x = !gf.periodic[0] && gf.cells[0] % 2 != 0;
  parallel.for_ranges(gf.cells[2], [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> row(static_cast<std::size_t>(nc));
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j < gf.cells[1]; ++j) {
        // A row of the coarse level, interpolated along y and z.
        const Pair pk = pairs[2][static_cast<std::size_t>(k)], pj = pairs[1][static_cast<std::size_t>(j)];
        const Real* nn = xc.data() + gc.padded(0, pj.near, pk.near);
        const Real* fn = xc.data() + gc.padded(0, pj.far, pk.near);
        const Real* nf = xc.data() + gc.padded(0, pj.near, pk.far);
        const Real* ff = xc.data() + gc.padded(0, pj.far, pk.far);
        const Real wj = pj.near_weight, wk = pk.near_weight, vj = pj.far_weight, vk = pk.far_weight;
        Real* target = row.data();
#pragma omp simd
        for (int i = 0; i < nc; ++i) target[i] = wk * (wj * nn[i] + vj * fn[i]) + vk * (wj * nf[i] + vj * ff[i]);
        // Then along x; cells without an equation are left alone.
        Real* out = x.data() + gf.padded(0, j, k);
        const Real* diagonal = fine.inverse_diagonal.data() + gf.padded(0, j, k);
        const int n = gf.cells[0];
        if (odd_x) {
          for (int i = 0; i < n; ++i)
            if (diagonal[i] > 0) out[i] += i % 2 ? Real(0.5) * (target[i / 2] + target[i / 2 + 1]) : target[i / 2];
          continue;
        }
        const auto add = [&](int i) {
          const Pair pi = pairs[0][static_cast<std::size_t>(i)];
          if (diagonal[i] > 0) out[i] += pi.near_weight * target[pi.near] + pi.far_weight * target[pi.far];
        };
        add(0);
        // Inside, fine cells 2c - 1 and 2c lie between the coarse cells c - 1 and c.
        for (int c = 1; 2 * c < n; ++c) {
          const Real a = target[c - 1], b = target[c];
          if (diagonal[2 * c - 1] > 0) out[2 * c - 1] += Real(0.75) * a + Real(0.25) * b;
          if (diagonal[2 * c] > 0) out[2 * c] += Real(0.75) * b + Real(0.25) * a;
        }
        if (n > 1) add(n - 1);
      }
  });
}

void coarsen_specific_volume(const Parallel& parallel, const Grid& fine, const std::vector<Real>& f, const Grid& coarse,
                             std::vector<Real>& c) {
  c.resize(coarse.node_count());
  // The three fine nodes that coarse node i reads along an axis (1/4 1/2 1/4; of an odd number of cells, in the middle
  // of an edge, 1/2 1/2 0), walls folded in.
  const auto odd = [&](int axis) {
    const auto a = static_cast<std::size_t>(axis);
    return !fine.periodic[a] && fine.cells[a] % 2 != 0;
  };
  const auto source = [&](int axis, int i, int d) {
    const int n = fine.cells[static_cast<std::size_t>(axis)], index = 2 * i + d;
    if (fine.periodic[static_cast<std::size_t>(axis)]) return (index + n) % n;
    if (index < 0) return odd(axis) ? 0 : -index;
    return std::min(index, n);
  };
  const auto weight = [&](int axis, int d) {
    if (odd(axis)) return d > 0 ? Real(0) : Real(0.5);
    return d ? Real(0.25) : Real(0.5);
  };
  const auto row = static_cast<std::size_t>(fine.cells[0] + 1);
  parallel.for_ranges(coarse.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Real> sum(row);
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j <= coarse.cells[1]; ++j) {
        std::fill(sum.begin(), sum.end(), Real(0));
        for (int dk = -1; dk <= 1; ++dk)
          for (int dj = -1; dj <= 1; ++dj) {
            const Real w = weight(1, dj) * weight(2, dk);
            if (w > 0)
              add_row(static_cast<int>(row), w, f.data() + fine.node(0, source(1, j, dj), source(2, k, dk)),
                      sum.data());
          }
        Real* out = c.data() + coarse.node(0, j, k);
        const auto at = [&](int i, int d) { return sum[static_cast<std::size_t>(source(0, i, d))]; };
        const Real side = weight(0, 1), middle = weight(0, 0);
        for (int i = 0; i <= coarse.cells[0]; ++i)
          out[i] = (middle * at(i, 0) + weight(0, -1) * at(i, -1)) + side * at(i, 1);
      }
  });
}

}  // namespace efsi::system
