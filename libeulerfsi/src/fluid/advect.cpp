#include "fluid/advect.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::fluid {

using grid::PackedField;
using grid::PackedSampler;
using grid::Quad;
using grid::TileMask;

namespace {

constexpr Real kRestCells = Real(1e-4);  // cells per step below which a tile is at rest

// Where the flow leads from x, given where it came from: x + step v(x + step/2 v) with the midpoint velocity ahead
// mirrored from the one behind, 2 v(x) - v(x - step/2 v), which keeps the order of the midpoint rule.
EFSI_INLINE Quad opposite(const Quad& from, const Quad& v, Real step) { return from + Real(2) * step * v; }

// Where the flow that leads to a node with velocity v comes from: the midpoint rule. Where half the way already leads
// through a wall it comes from the wall: the midpoint's velocity there, at a no-slip wall none, would keep a jet away
// from the wall where it is for ever.
EFSI_INLINE Quad place_before(const PackedSampler& sampler, const PackedField& flow, const Quad& node, const Quad& v,
                              Real step) {
  if (sampler.cut_by_wall(node, node - Real(0.5) * step * v)) return sampler.keep_inside(node - step * v);
  return sampler.keep_inside(sampler.trace_midpoint(flow, node, v, step));
}

// Cells that a velocity goes in a step, at most 1.
EFSI_INLINE Real way(const Quad& v, Real step) {
  const Quad square = v * v;
  return std::min(Real(1), step * std::sqrt(square[0] + square[1] + square[2]));
}

// The hourglass part of a node field: what alternates from node to node along two axes or three. The divergence in the
// middle of a cell does not see it. Along each axis a field is smooth + alternating, (1 2 1)/4 + (-1 2 -1)/4; walls
// mirror it. Rows of nodes are gone along in steps of one node.
class Hourglass {
 public:
  // Begins at node i of row j, k.
  EFSI_INLINE Hourglass(const Grid& g, const PackedField& field, int i, int j, int k) : field_(field) {
    const Around y = around(g, 1, j), z = around(g, 2, k);
    const std::size_t rows[3] = {y.lower, static_cast<std::size_t>(j), y.upper};
    const std::size_t slabs[3] = {z.lower, static_cast<std::size_t>(k), z.upper};
    for (std::size_t b = 0; b < 3; ++b)
      for (std::size_t a = 0; a < 3; ++a) row_[3 * b + a] = g.node_stride(1) * rows[a] + g.node_stride(2) * slabs[b];
    last_ = g.cells[0];
    end_ = around(g, 0, last_).upper;
    before_ = column(around(g, 0, i).lower);
    here_ = column(static_cast<std::size_t>(i));
  }
  // The part at node i, the one after the node of the last call.
  EFSI_INLINE Quad next(int i) {
    const std::size_t n = static_cast<std::size_t>(i);
    const Column after = column(i == last_ ? end_ : n + 1);
    const Quad mixed = Real(0.25) * (before_.mixed + after.mixed) + Real(0.5) * here_.mixed;
    const Quad part = grid::load_quad(field_.at(row_[4] + n)) - here_.smooth - mixed;
    before_ = here_;
    here_ = after;
    return part;
  }

 private:
  struct Around {
    std::size_t lower, upper;
  };
  struct Column {
    Quad smooth;  // along y and z
    Quad mixed;   // smooth along one of them and alternating along the other
  };

  static Around around(const Grid& g, int axis, int i) {
    const auto a = static_cast<std::size_t>(axis);
    const int last = g.cells[a];
    const int lower = i > 0 ? i - 1 : (g.periodic[a] ? last - 1 : 1);
    const int upper = i < last ? i + 1 : (g.periodic[a] ? 1 : last - 1);
    return {static_cast<std::size_t>(lower), static_cast<std::size_t>(upper)};
  }
  EFSI_INLINE Column column(std::size_t i) const {
    Quad v[9];
    for (std::size_t a = 0; a < 9; ++a) v[a] = grid::load_quad(field_.at(row_[a] + i));
    const Quad along_y = Real(0.25) * (v[3] + v[5]) + Real(0.5) * v[4];
    const Quad along_z = Real(0.25) * (v[1] + v[7]) + Real(0.5) * v[4];
    const Quad lower = Real(0.25) * (v[0] + v[2]) + Real(0.5) * v[1];
    const Quad upper = Real(0.25) * (v[6] + v[8]) + Real(0.5) * v[7];
    const Quad smooth = Real(0.25) * (lower + upper) + Real(0.5) * along_y;
    return {smooth, along_y + along_z - Real(2) * smooth};
  }

  const PackedField& field_;
  std::size_t row_[9];
  int last_;
  std::size_t end_;
  Column before_, here_;
};

// Nodes [begin, end) of row j, k; node: index of node 0 of the row.
struct Row {
  int j, k, begin, end;
  std::size_t node;
};

// Packs a tile of the velocity and returns its largest component.
EFSI_KERNEL Real pack_tile(const Grid& g, const Vec3i& begin, const Vec3i& end, const VectorField& velocity,
                           PackedField& packed) {
  Quad top = {0, 0, 0, 0};
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j) {
      const std::size_t row = g.node(begin[0], j, k);
      const Real *x = velocity.c[0].data() + row, *y = velocity.c[1].data() + row, *z = velocity.c[2].data() + row;
      Real* to = packed.at(row);
      for (int i = 0; i < end[0] - begin[0]; ++i) {
        const Quad v = {x[i], y[i], z[i], 0};
        grid::store_quad(to + 4 * i, v);
        const Quad size = v < -v ? -v : v;
        top = size > top ? size : top;
      }
    }
  return std::max({top[0], top[1], top[2]});
}

// What arrives at the nodes of a row, and where it comes from.
EFSI_KERNEL void carry_row(const PackedSampler& nodes, const Row& row, Real step, const PackedField& flow,
                           PackedField& first, VectorField& origin) {
  const PackedSampler sampler = nodes;
  const std::size_t begin = row.node + static_cast<std::size_t>(row.begin);
  const Real* v = flow.at(begin);
  Real *arrived = first.at(begin), *x = origin.c[0].data() + begin, *y = origin.c[1].data() + begin,
       *z = origin.c[2].data() + begin;
  Quad node = {static_cast<Real>(row.begin), static_cast<Real>(row.j), static_cast<Real>(row.k), 0};
  for (int i = 0; i < row.end - row.begin; ++i) {
    const Quad from = place_before(sampler, flow, node, grid::load_quad(v + 4 * i), step);
    grid::store_quad(arrived + 4 * i, sampler.value(flow, from));
    x[i] = from[0];
    y[i] = from[1];
    z[i] = from[2];
    node += Quad{1, 0, 0, 0};
  }
}

// Takes half the error of going there and back off what arrives, and of its hourglass part as much as the flow moves on
// in cells: nothing else resists it. result: in where it comes from.
EFSI_KERNEL void correct_row(const Grid& g, const PackedSampler& nodes, const Row& row, Real step,
                             const Real* specific_volume, Real fluid_volume, const PackedField& flow,
                             const PackedField& first, VectorField& result) {
  const PackedSampler sampler = nodes;
  const std::size_t begin = row.node + static_cast<std::size_t>(row.begin);
  const Real *v = flow.at(begin), *arrived = first.at(begin), *s = specific_volume + begin;
  Real *x = result.c[0].data() + begin, *y = result.c[1].data() + begin, *z = result.c[2].data() + begin;
  Hourglass hourglass(g, first, row.begin, row.j, row.k);
  for (int i = 0; i < row.end - row.begin; ++i) {
    Quad w = grid::load_quad(arrived + 4 * i);
    const Quad alternating = hourglass.next(row.begin + i);
    if (s[i] == fluid_volume) {  // beside a solid: first order
      const Quad from = {x[i], y[i], z[i], 0}, v0 = grid::load_quad(v + 4 * i);
      const Quad to = sampler.keep_inside(opposite(from, v0, step));
      const Quad here = {static_cast<Real>(row.begin + i), static_cast<Real>(row.j), static_cast<Real>(row.k), 0};
      if (!sampler.cut_by_wall(here, from) && !sampler.cut_by_wall(here, to)) {
        w = w + Real(0.5) * (v0 - sampler.value(first, to));
        w = sampler.limit(flow, sampler.place(from), w);  // no new extremes
      }
      w = w - way(v0, step) * alternating;
    }
    x[i] = w[0];
    y[i] = w[1];
    z[i] = w[2];
  }
}

void unpack_row(const Row& row, const PackedField& packed, VectorField& result) {
  for (int i = row.begin; i < row.end; ++i) {
    const std::size_t n = row.node + static_cast<std::size_t>(i);
    const Real* v = packed.at(n);
    for (std::size_t a = 0; a < 3; ++a) result.c[a][n] = v[a];
  }
}

}  // namespace

void set_flow(const Parallel& parallel, const Grid& g, const VectorField& velocity, AdvectWorkspace& work) {
  const TileMask tiles(g.nodes());
  work.flow.resize(g.node_count());
  work.flow_top.resize(static_cast<std::size_t>(tiles.count()));
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    Vec3i begin, end;
    tiles.range(t, begin, end);
    work.flow_top[static_cast<std::size_t>(t)] = pack_tile(g, begin, end, velocity, work.flow);
  });
}

std::uint64_t advect_velocity(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                              const std::vector<Real>& specific_volume, Real fluid_volume, FluidState& state,
                              AdvectWorkspace& work) {
  const PackedSampler sampler(g);
  const Real step = static_cast<Real>(dt / g.h);
  TileMask tiles(g.nodes());
  for (std::int64_t t = 0; t < tiles.count(); ++t)
    tiles.set(t, work.flow_top[static_cast<std::size_t>(t)] * step > kRestCells);
  tiles.dilate(g.periodic);

  work.first.resize(g.node_count());
  for (auto& component : state.velocity.c) component.resize(g.node_count());
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    const Row row = {j, k, begin, end, g.node(0, j, k)};
    if (active) {
      carry_row(sampler, row, step, work.flow, work.first, state.velocity);
    } else {
      const std::size_t n = row.node + static_cast<std::size_t>(begin);
      std::copy_n(work.flow.at(n), 4 * static_cast<std::size_t>(end - begin), work.first.at(n));
    }
  });
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    const Row row = {j, k, begin, end, g.node(0, j, k)};
    if (active && corrected)
      correct_row(g, sampler, row, step, specific_volume.data(), fluid_volume, work.flow, work.first, state.velocity);
    else
      unpack_row(row, work.first, state.velocity);
  });
  return tiles.active_count();
}

}  // namespace efsi::fluid
