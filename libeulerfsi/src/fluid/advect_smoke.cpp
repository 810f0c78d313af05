// Purpose: transport of cell-centred fields; see advect.hpp.
#include <algorithm>
#include <cmath>

#include "fluid/advect.hpp"
#include "fluid/transport.hpp"

namespace efsi::fluid {

using grid::kLanes;
using grid::Octet;
using grid::Octets;
using grid::Quad;
using grid::TileMask;

namespace {

constexpr Real kNoSmoke = Real(1e-5);  // below this there is no smoke

// Samples cell-centred fields; positions in grid units of the nodes.
class CellSampler {
 public:
  explicit CellSampler(const Grid& g) {
    stride_[0] = 1;
    for (std::size_t a = 0; a < 3; ++a) {
      cells_[a] = g.cells[a];
      periodic_[a] = g.periodic[a];
      if (a > 0) stride_[a] = stride_[a - 1] * g.cells[a - 1];
    }
  }
  // The 8 cells around a position: the lowest one, the steps to the next along each axis, and where between them.
  struct Place {
    std::ptrdiff_t cell, next[3];
    Real part[3];
  };
  EFSI_INLINE Place place(const Quad& g) const {
    Place at;
    at.cell = 0;
    for (int a = 0; a < 3; ++a) {
      const int n = cells_[a];
      Real x = g[a] - Real(0.5);
      int low, high;
      if (periodic_[a]) {
        x -= std::floor(x / static_cast<Real>(n)) * static_cast<Real>(n);
        low = std::min(static_cast<int>(x), n - 1);
        high = low + 1 < n ? low + 1 : 0;
      } else {
        x = x > 0 ? x : Real(0);
        x = x < static_cast<Real>(n - 1) ? x : static_cast<Real>(n - 1);
        low = std::min(static_cast<int>(x), std::max(0, n - 2));
        high = std::min(low + 1, n - 1);
      }
      at.part[a] = x - static_cast<Real>(low);
      at.cell += stride_[a] * low;
      at.next[a] = stride_[a] * (high - low);
    }
    return at;
  }
  EFSI_INLINE Real value(const Real* field, const Place& at) const {
    const Real* p = field + at.cell;
    const auto x = at.next[0], y = at.next[1], z = at.next[2];
    const auto mix = [](Real a, Real b, Real t) { return a + t * (b - a); };
    const Real a = mix(p[0], p[z], at.part[2]), b = mix(p[x], p[x + z], at.part[2]);
    const Real c = mix(p[y], p[y + z], at.part[2]), d = mix(p[x + y], p[x + y + z], at.part[2]);
    return mix(mix(a, c, at.part[1]), mix(b, d, at.part[1]), at.part[0]);
  }
  // v limited to the range of the 8 values around a position.
  EFSI_INLINE Real limit(const Real* field, const Place& at, Real v) const {
    const Real* p = field + at.cell;
    Real low = p[0], high = p[0];
    for (const auto z : {std::ptrdiff_t{0}, at.next[2]})
      for (const auto y : {std::ptrdiff_t{0}, at.next[1]})
        for (const auto x : {std::ptrdiff_t{0}, at.next[0]}) {
          const Real f = p[x + y + z];
          low = f < low ? f : low;
          high = f > high ? f : high;
        }
    v = v > low ? v : low;
    return v < high ? v : high;
  }

 private:
  int cells_[3];
  std::ptrdiff_t stride_[3];
  bool periodic_[3];
};

// A row of cells; node: index of node 0 of the row.
struct CellRow : Row {
  std::size_t node;
};

// The transport of a cell-centred field.
struct Transport {
  NodeTransport nodes;
  CellSampler cells;
  grid::LaneSampler lanes;
  Vec3i count;  // cells
  Real step;
  const VectorField& flow;
};

EFSI_INLINE Quad center(const CellRow& row, int i) {
  return Quad{static_cast<Real>(i), static_cast<Real>(row.j), static_cast<Real>(row.k), 0} +
         Quad{Real(0.5), Real(0.5), Real(0.5), 0};
}
EFSI_INLINE Quad center_velocity(const Transport& t, const CellRow& row, int i) {
  return t.nodes.sampler.value(t.flow,
                               {row.node + static_cast<std::size_t>(i), Quad{Real(0.5), Real(0.5), Real(0.5), 0}});
}
EFSI_INLINE Octets center_velocities(const Transport& t, const CellRow& row, int i) {
  const std::size_t n = row.node + static_cast<std::size_t>(i), y = static_cast<std::size_t>(t.nodes.points[0]),
                    z = y * static_cast<std::size_t>(t.nodes.points[1]);
  Octets v;
  for (std::size_t a = 0; a < 3; ++a) {
    const Real* p = t.flow.c[a].data() + n;
    const auto edge = [p](std::size_t m)
                          EFSI_INLINE_LAMBDA { return grid::load_octet(p + m) + grid::load_octet(p + m + 1); };
    v.c[a] = Real(0.125) * ((edge(0) + edge(y)) + (edge(z) + edge(y + z)));
  }
  return v;
}
// Where eight cells read that are displaced by e; beyond the last centre the field is constant.
EFSI_INLINE bool place_of(const Transport& t, const CellRow& row, int i, const Octets& e,
                          grid::LaneSampler::Place& at) {
  return t.lanes.place(i, row.j, row.k, Room(t.count, t.nodes.periodic, row, i).keep(e), at);
}

// What arrives in a cell, and how far it is from its centre to where that comes from.
EFSI_INLINE void carry_cell(const Transport& t, const CellRow& row, int i, const Real* source, Real* first,
                            VectorField& back) {
  const Quad from = t.nodes.sampler.trace_midpoint(t.flow, center(row, i), center_velocity(t, row, i), t.step);
  const std::size_t c = row.first + static_cast<std::size_t>(i);
  set_node(back, c, from - center(row, i));
  first[c] = t.cells.value(source, t.cells.place(t.nodes.sampler.keep_inside(from)));
}

// The same for the cells from i on. False: they have to be done one by one.
EFSI_INLINE bool carry_cells(const Transport& t, const CellRow& row, int i, const Real* source, Real* first,
                             VectorField& back) {
  const std::size_t c = row.first + static_cast<std::size_t>(i), n = row.node + static_cast<std::size_t>(i);
  grid::LaneSampler::Cell cell;
  grid::LaneSampler::Place at;
  Octets half = scaled(center_velocities(t, row, i), Real(-0.5) * t.step), from;
  for (Octet& e : half.c) e += Real(0.5);  // from the node
  if (t.nodes.lanes.place(i, row.j, row.k, half, cell))
    from = scaled(t.nodes.lanes.value(t.flow, n, cell), -t.step);
  else if (t.nodes.lanes.place(i, row.j, row.k, half, at))
    from = scaled(t.nodes.lanes.value(t.flow, n, at), -t.step);
  else
    return false;
  if (t.lanes.place(i, row.j, row.k, from, cell))
    grid::store_octet(first + c, t.lanes.value(source + c, cell));
  else if (place_of(t, row, i, from, at))
    grid::store_octet(first + c, t.lanes.value(source + c, at));
  else
    return false;
  grid::store_octets(back, c, from);
  return true;
}

EFSI_KERNEL void carry_row(const Transport& t, const CellRow& row, const Real* source, Real* first, VectorField& back) {
  const auto one = [&](int i) EFSI_INLINE_LAMBDA { carry_cell(t, row, i, source, first, back); };
  for_lanes(row, t.count[0] - 1, one, [&](int i, int) EFSI_INLINE_LAMBDA {
    if (carry_cells(t, row, i, source, first, back)) return;
    for (int l = 0; l < kLanes; ++l) one(i + l);
  });
}

// What arrives in a cell less half the error of going there and back. fraction may be null: beside a solid, where it is
// not 0, what arrives stays as it is; limited all the same, for its rounding can leave the range of what it comes from.
EFSI_INLINE Real corrected_cell(const Transport& t, const CellRow& row, int i, const VectorField& back,
                                const Real* fraction, const Real* source, const Real* first) {
  const std::size_t c = row.first + static_cast<std::size_t>(i);
  const Quad v = center_velocity(t, row, i), behind = node_value(back, c), from = center(row, i) + behind;
  const Quad to = t.nodes.sampler.keep_inside(center(row, i) + opposite(behind, v, t.step));
  const bool plain = fraction && fraction[c] > 0;
  const Real w = plain ? first[c] : first[c] + Real(0.5) * (source[c] - t.cells.value(first, t.cells.place(to)));
  return t.cells.limit(source, t.cells.place(t.nodes.sampler.keep_inside(from)), w);
}

// The same for the cells from i on. False: they have to be done one by one.
EFSI_INLINE bool corrected_cells(const Transport& t, const CellRow& row, int i, const VectorField& back,
                                 const Real* fraction, const Real* source, const Real* first, Octet& w) {
  const std::size_t c = row.first + static_cast<std::size_t>(i);
  const Octets v = center_velocities(t, row, i);
  const Octets from = grid::load_octets(back, c);
  Octets to;
  for (std::size_t a = 0; a < 3; ++a) to.c[a] = opposite(from.c[a], v.c[a], t.step);
  const auto correct = [&](const auto& ahead, const auto& behind) EFSI_INLINE_LAMBDA {
    const Octet arrived = grid::load_octet(first + c);
    Octet better = arrived + Real(0.5) * (grid::load_octet(source + c) - t.lanes.value(first + c, ahead));
    if (fraction) better = grid::load_octet(fraction + c) > Octet{} ? arrived : better;
    w = t.lanes.limit(source + c, behind, better);
  };
  grid::LaneSampler::Cell to_cell, from_cell;
  if (t.lanes.place(i, row.j, row.k, to, to_cell) && t.lanes.place(i, row.j, row.k, from, from_cell)) {
    correct(to_cell, from_cell);
    return true;
  }
  grid::LaneSampler::Place ahead, behind;
  if (!place_of(t, row, i, to, ahead) || !place_of(t, row, i, from, behind)) return false;
  correct(ahead, behind);
  return true;
}

EFSI_KERNEL void correct_row(const Transport& t, const CellRow& row, const VectorField& back, const Real* fraction,
                             const Real* source, const Real* first, Real* result) {
  const auto one = [&](int i) EFSI_INLINE_LAMBDA {
    result[row.first + static_cast<std::size_t>(i)] = corrected_cell(t, row, i, back, fraction, source, first);
  };
  for_lanes(row, t.count[0] - 1, one, [&](int i, int) EFSI_INLINE_LAMBDA {
    Octet w;
    if (corrected_cells(t, row, i, back, fraction, source, first, w)) {
      grid::store_octet(result + row.first + static_cast<std::size_t>(i), w);
      return;
    }
    for (int l = 0; l < kLanes; ++l) one(i + l);
  });
}

EFSI_KERNEL Real top_of_tile(const Grid& g, const Vec3i& begin, const Vec3i& end, const Real* field) {
  Real top = 0;
  Octet tops{};
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j) {
      const Real* row = field + g.cell(begin[0], j, k);
      if (end[0] - begin[0] == kLanes) {
        const Octet v = grid::load_octet(row);
        tops = grid::larger(tops, grid::larger(v, -v));
      } else {
        for (int i = 0; i < end[0] - begin[0]; ++i) top = std::max(top, std::abs(row[i]));
      }
    }
  return std::max(top, grid::greatest(tops));
}

// Flags the solid cells of a row; true where there is one.
EFSI_KERNEL bool mark_solid(int count, const Real* fraction, std::uint8_t* solid) {
  std::uint8_t any = 0;
#pragma omp simd reduction(| : any)
  for (int i = 0; i < count; ++i) {
    solid[i] = fraction[i] > Real(0.5);
    any |= solid[i];
  }
  return any != 0;
}

// Mean of the fluid cells among the 5^3 around a cell.
Real mean_of_fluid_around(const Grid& g, const std::vector<Real>& fraction, const std::vector<Real>& field, int i,
                          int j, int k) {
  Real sum = 0;
  int count = 0;
  for (int q = std::max(0, k - 2); q <= std::min(g.cells[2] - 1, k + 2); ++q)
    for (int p = std::max(0, j - 2); p <= std::min(g.cells[1] - 1, j + 2); ++p)
      for (int o = std::max(0, i - 2); o <= std::min(g.cells[0] - 1, i + 2); ++o) {
        const std::size_t m = g.cell(o, p, q);
        if (fraction[m] > Real(0.5)) continue;
        sum += field[m];
        ++count;
      }
  return count ? sum / static_cast<Real>(count) : Real(0);
}

// Where nothing is nor comes to the field is 0, and what is read of it, too.
void clear_idle(const Parallel& parallel, const Grid& g, const TileMask& tiles, const std::vector<Real>& top,
                std::vector<Real>& field, AdvectWorkspace& work) {
  work.scalar_source.resize(field.size());
  work.scalar_first.resize(field.size());
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    if (active) return;
    for (auto* values : {&work.scalar_source, &work.scalar_first})
      std::fill_n(values->data() + g.cell(begin, j, k), end - begin, Real(0));
  });
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (tiles.active(t) || top[static_cast<std::size_t>(t)] == 0) return;
    Vec3i begin, end;
    tiles.range(t, begin, end);
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j)
        std::fill_n(field.data() + g.cell(begin[0], j, k), end[0] - begin[0], Real(0));
  });
}

std::uint64_t advect_scalar(const Parallel& parallel, const Grid& g, bool corrected, double dt, const VectorField& flow,
                            const std::vector<Real>& fraction, std::span<const SourceCell> sources,
                            std::vector<Real>& field, AdvectWorkspace& work, ScalarBudget& budget) {
  // Tiles with smoke, and their neighbours.
  TileMask tiles(g.cells);
  std::vector<Real> top(static_cast<std::size_t>(tiles.count()));
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    Vec3i begin, end;
    tiles.range(t, begin, end);
    top[static_cast<std::size_t>(t)] = top_of_tile(g, begin, end, field.data());
    tiles.set(t, top[static_cast<std::size_t>(t)] > kNoSmoke);
  });
  budget.close();
  if (tiles.active_count() == 0) return 0;
  tiles.dilate(g.periodic);
  clear_idle(parallel, g, tiles, top, field, work);

  const Transport transport = {
      NodeTransport(g), CellSampler(g), grid::LaneSampler(g.cells), g.cells, static_cast<Real>(dt / g.h), flow};
  std::vector<Real>& source = work.scalar_source;
  std::vector<Real>& first = work.scalar_first;
  for (auto& component : work.first.c) component.resize(g.node_count());
  work.solid_cells.resize(fraction.size());

  // Cells inside solids are filled, so that a trace that ends in a solid finds the smoke beside it.
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    if (!active) return;
    const std::size_t row = g.cell(0, j, k);
    std::copy(field.data() + row + begin, field.data() + row + end, source.data() + row + begin);
    if (fraction.empty()) return;
    if (!mark_solid(end - begin, fraction.data() + row + begin, work.solid_cells.data() + row + begin)) return;
    for (int i = begin; i < end; ++i) {
      const std::size_t c = row + static_cast<std::size_t>(i);
      if (work.solid_cells[c]) source[c] = mean_of_fluid_around(g, fraction, field, i, j, k);
    }
  });
  budget.open(parallel, g, corrected, tiles, top, field, work.solid_cells);
  budget.bring_in(g, dt, sources, field);
  // Semi-Lagrangian transport.
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    const CellRow row = {{j, k, begin, end, g.cell(0, j, k)}, g.node(0, j, k)};
    if (active) carry_row(transport, row, source.data(), first.data(), work.first);
  });
  // Its correction (MacCormack).
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    if (!active) return;
    const CellRow row = {{j, k, begin, end, g.cell(0, j, k)}, g.node(0, j, k)};
    if (corrected)
      correct_row(transport, row, work.first, fraction.empty() ? nullptr : fraction.data(), source.data(), first.data(),
                  field.data());
    else
      std::copy(first.data() + row.first + begin, first.data() + row.first + end, field.data() + row.first + begin);
  });
  budget.count(parallel, g, work.first, field, work.solid_cells);
  return tiles.active_count();
}

}  // namespace

std::uint64_t advect_smoke(const Parallel& parallel, const Grid& g, bool corrected, double dt, const VectorField& flow,
                           const std::vector<Real>& cell_fraction, FluidState& state, AdvectWorkspace& work,
                           std::span<const SourceCell> sources) {
  for (const SourceCell& source : sources) {
    const std::size_t c = g.cell(source.place[0], source.place[1], source.place[2]);
    if (!cell_fraction.empty() && cell_fraction[c] > Real(0.5)) continue;
    if (!state.smoke.empty()) state.smoke[c] = source.smoke;
    if (!state.temperature.empty()) state.temperature[c] = source.temperature;
  }
  std::uint64_t tiles = 0;
  if (!state.smoke.empty())
    tiles +=
        advect_scalar(parallel, g, corrected, dt, flow, cell_fraction, sources, state.smoke, work, work.budgets[0]);
  if (!state.temperature.empty())
    tiles += advect_scalar(parallel, g, corrected, dt, flow, cell_fraction, sources, state.temperature, work,
                           work.budgets[1]);
  return tiles;
}

void settle_smoke(const Parallel& parallel, const Grid& g, const Walls& walls, const std::vector<Real>& cell_fraction,
                  FluidState& state, AdvectWorkspace& work) {
  if (!state.smoke.empty()) work.budgets[0].settle(parallel, g, walls, work.solid_cells, cell_fraction, state.smoke);
  if (!state.temperature.empty())
    work.budgets[1].settle(parallel, g, walls, work.solid_cells, cell_fraction, state.temperature);
}

}  // namespace efsi::fluid
