#include "fluid/advect.hpp"

#include <algorithm>
#include <cmath>

#include "grid/interpolate.hpp"

namespace efsi::fluid {

using grid::NodeSampler;
using grid::TileMask;
using grid::Trilinear;

namespace {

constexpr Real kRestCells = Real(1e-4);  // cells per step below which a tile is at rest
constexpr Real kNoSmoke = Real(1e-5);    // below this there is no smoke

template <class Body>
void for_tile(const TileMask& tiles, std::int64_t t, const Body& body) {
  Vec3i begin, end;
  tiles.range(t, begin, end);
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j)
      for (int i = begin[0]; i < end[0]; ++i) body(i, j, k);
}

EFSI_INLINE Vec3 keep_inside(const Grid& g, Vec3 x) {
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    if (!g.periodic[s]) x[a] = std::clamp(x[a], Real(0), static_cast<Real>(g.cells[s]));
  }
  return x;
}

// Whether keep_inside has cut a trace that began at x: nothing is known of what comes from beyond a wall.
EFSI_INLINE bool cut_by_wall(const Grid& g, const Vec3& x, const Vec3& end) {
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    if (!g.periodic[s] && end[a] != x[a] && (end[a] <= 0 || end[a] >= static_cast<Real>(g.cells[s]))) return true;
  }
  return false;
}

// Where the flow leads from x, given where it came from: x + step v(x + step/2 v) with the midpoint velocity ahead
// mirrored from the one behind, 2 v(x) - v(x - step/2 v), which keeps the order of the midpoint rule.
EFSI_INLINE Vec3 opposite(const Vec3& from, const Vec3& v, Real step) { return from + Real(2) * step * v; }

// Samples cell-centred fields; positions in grid units of the nodes.
class CellSampler {
 public:
  explicit CellSampler(const Grid& g)
      : cells_(g.cells),
        stride_{1, static_cast<std::size_t>(g.cells[0]),
                static_cast<std::size_t>(g.cells[0]) * static_cast<std::size_t>(g.cells[1])},
        periodic_(g.periodic) {}
  // Indices and weights of the 8 cells around a position.
  EFSI_INLINE void stencil(const Vec3& g, std::size_t index[8], Real weight[8]) const {
    int low[3], high[3];
    Real f[3];
    for (int a = 0; a < 3; ++a) {
      const auto s = static_cast<std::size_t>(a);
      const int n = cells_[s];
      Real x = g[a] - Real(0.5);
      if (periodic_[s]) {
        x = grid::wrap(x, static_cast<Real>(n));
        low[a] = std::min(static_cast<int>(x), n - 1);
        high[a] = (low[a] + 1) % n;
      } else {
        x = std::clamp(x, Real(0), static_cast<Real>(n - 1));
        low[a] = std::min(static_cast<int>(x), std::max(0, n - 2));
        high[a] = std::min(low[a] + 1, n - 1);
      }
      f[a] = x - static_cast<Real>(low[a]);
    }
    for (std::size_t c = 0; c < 8; ++c) {
      const int* o = grid::kCorner[c];
      index[c] = static_cast<std::size_t>(o[0] ? high[0] : low[0]) +
                 stride_[1] * static_cast<std::size_t>(o[1] ? high[1] : low[1]) +
                 stride_[2] * static_cast<std::size_t>(o[2] ? high[2] : low[2]);
      weight[c] = (o[0] ? f[0] : 1 - f[0]) * (o[1] ? f[1] : 1 - f[1]) * (o[2] ? f[2] : 1 - f[2]);
    }
  }

 private:
  Vec3i cells_;
  std::array<std::size_t, 3> stride_;
  std::array<bool, 3> periodic_;
};

}  // namespace

std::uint64_t advect_velocity(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                              const std::vector<Real>& specific_volume, Real fluid_volume, const VectorField& velocity,
                              FluidState& state, AdvectWorkspace& work) {
  const NodeSampler sampler(g);
  const Real step = static_cast<Real>(dt / g.h);
  TileMask tiles(g.nodes());
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    Real speed = 0;
    for_tile(tiles, t, [&](int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      for (const auto& c : velocity.c) speed = std::max(speed, std::abs(c[n]));
    });
    tiles.set(t, speed * step > kRestCells);
  });
  tiles.dilate(g.periodic);

  // First sweep: carried values; where they come from stays in `result` for the second.
  work.first.c = velocity.c;
  work.result.c = velocity.c;
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (!tiles.active(t)) return;
    for_tile(tiles, t, [&](int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      const Vec3 x(static_cast<Real>(i), static_cast<Real>(j), static_cast<Real>(k));
      const Vec3 from = keep_inside(g, grid::trace_midpoint(sampler, velocity, x, velocity.at(n), step));
      work.first.set(n, sampler.vector(velocity, from));
      work.result.set(n, from);
    });
  });
  if (!corrected) {
    std::swap(state.velocity.c, work.first.c);
    return tiles.active_count();
  }
  // Second sweep: half the error of going there and back is taken off.
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (!tiles.active(t)) return;
    for_tile(tiles, t, [&](int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      if (specific_volume[n] != fluid_volume) {  // beside a solid: first order
        work.result.set(n, work.first.at(n));
        return;
      }
      const Vec3 v = velocity.at(n), from = work.result.at(n);
      const Vec3 x(static_cast<Real>(i), static_cast<Real>(j), static_cast<Real>(k));
      const Vec3 to = keep_inside(g, opposite(from, v, step));
      if (cut_by_wall(g, x, from) || cut_by_wall(g, x, to)) {
        work.result.set(n, work.first.at(n));
        return;
      }
      Vec3 w = work.first.at(n) + Real(0.5) * (v - sampler.vector(work.first, to));
      const Trilinear source = sampler.stencil(from);
      for (int a = 0; a < 3; ++a) {  // no new extremes
        const Real* field = velocity.c[static_cast<std::size_t>(a)].data() + source.base;
        Real low = field[0], high = field[0];
        for (std::size_t offset : sampler.corners()) {
          low = std::min(low, field[offset]);
          high = std::max(high, field[offset]);
        }
        w[a] = std::clamp(w[a], low, high);
      }
      work.result.set(n, w);
    });
  });
  std::swap(state.velocity.c, work.result.c);
  return tiles.active_count();
}

namespace {

// Fills cells inside solids from their neighbours, so that a trace that ends in a solid finds the smoke beside it.
void fill_solid_cells(const Parallel& parallel, const Grid& g, const std::vector<Real>& fraction, const TileMask& tiles,
                      const std::vector<Real>& field, std::vector<Real>& filled) {
  filled = field;
  if (fraction.empty()) return;
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (!tiles.active(t)) return;
    for_tile(tiles, t, [&](int i, int j, int k) {
      const std::size_t c = g.cell(i, j, k);
      if (!(fraction[c] > Real(0.5))) return;
      Real sum = 0;
      int count = 0;
      for (int dk = -2; dk <= 2; ++dk)
        for (int dj = -2; dj <= 2; ++dj)
          for (int di = -2; di <= 2; ++di) {
            const int q[3] = {i + di, j + dj, k + dk};
            if (q[0] < 0 || q[1] < 0 || q[2] < 0 || q[0] >= g.cells[0] || q[1] >= g.cells[1] || q[2] >= g.cells[2])
              continue;
            const std::size_t m = g.cell(q[0], q[1], q[2]);
            if (fraction[m] > Real(0.5)) continue;
            sum += field[m];
            ++count;
          }
      filled[c] = count ? sum / static_cast<Real>(count) : Real(0);
    });
  });
}

std::uint64_t advect_scalar(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                            const VectorField& velocity, const std::vector<Real>& fraction, std::vector<Real>& field,
                            AdvectWorkspace& work) {
  TileMask tiles(g.cells);
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    Real top = 0;
    for_tile(tiles, t, [&](int i, int j, int k) { top = std::max(top, std::abs(field[g.cell(i, j, k)])); });
    tiles.set(t, top > kNoSmoke);
  });
  if (tiles.active_count() == 0) return 0;
  tiles.dilate(g.periodic);

  const NodeSampler nodes(g);
  const CellSampler cells(g);
  const Real step = static_cast<Real>(dt / g.h);
  std::vector<Real>& source = work.scalar_source;
  std::vector<Real>& first = work.scalar_first;
  std::vector<Real>& result = work.scalar_result;
  fill_solid_cells(parallel, g, fraction, tiles, field, source);
  first.assign(field.size(), 0);
  const auto center = [](int i, int j, int k) {
    return Vec3(static_cast<Real>(i) + Real(0.5), static_cast<Real>(j) + Real(0.5), static_cast<Real>(k) + Real(0.5));
  };
  const auto value = [](const std::vector<Real>& f, const std::size_t index[8], const Real weight[8]) {
    Real sum = 0;
    for (int a = 0; a < 8; ++a) sum += weight[a] * f[index[a]];
    return sum;
  };
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (!tiles.active(t)) return;
    for_tile(tiles, t, [&](int i, int j, int k) {
      const Vec3 x = center(i, j, k);
      const Vec3 from = keep_inside(g, grid::trace_midpoint(nodes, velocity, x, nodes.vector(velocity, x), step));
      std::size_t index[8];
      Real weight[8];
      cells.stencil(from, index, weight);
      first[g.cell(i, j, k)] = value(source, index, weight);
    });
  });
  result = first;
  if (corrected)
    parallel.for_each(tiles.count(), [&](std::int64_t t) {
      if (!tiles.active(t)) return;
      for_tile(tiles, t, [&](int i, int j, int k) {
        const std::size_t c = g.cell(i, j, k);
        if (!fraction.empty() && fraction[c] > 0) return;  // beside a solid: first order
        const Vec3 x = center(i, j, k), v = nodes.vector(velocity, x);
        std::size_t index[8];
        Real weight[8];
        const Vec3 from = grid::trace_midpoint(nodes, velocity, x, v, step);
        cells.stencil(keep_inside(g, opposite(from, v, step)), index, weight);
        const Real w = first[c] + Real(0.5) * (source[c] - value(first, index, weight));
        cells.stencil(keep_inside(g, from), index, weight);
        Real low = source[index[0]], high = low;
        for (int a = 1; a < 8; ++a) {
          low = std::min(low, source[index[a]]);
          high = std::max(high, source[index[a]]);
        }
        result[c] = std::clamp(w, low, high);
      });
    });
  if (!fraction.empty())
    parallel.for_each(tiles.count(), [&](std::int64_t t) {
      if (!tiles.active(t)) return;
      for_tile(tiles, t, [&](int i, int j, int k) {
        const std::size_t c = g.cell(i, j, k);
        if (fraction[c] > Real(0.5)) result[c] = 0;
      });
    });
  std::swap(field, result);
  return tiles.active_count();
}

}  // namespace

std::uint64_t advect_smoke(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                           const VectorField& velocity, const std::vector<Real>& cell_fraction, FluidState& state,
                           AdvectWorkspace& work) {
  std::uint64_t tiles = 0;
  if (!state.smoke.empty())
    tiles += advect_scalar(parallel, g, corrected, dt, velocity, cell_fraction, state.smoke, work);
  if (!state.temperature.empty())
    tiles += advect_scalar(parallel, g, corrected, dt, velocity, cell_fraction, state.temperature, work);
  return tiles;
}

}  // namespace efsi::fluid
