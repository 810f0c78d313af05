#include "fluid/advect.hpp"

#include <algorithm>
#include <cmath>

#include "fluid/transport.hpp"

namespace efsi::fluid {

using grid::kLanes;
using grid::Octet;
using grid::Octets;
using grid::Quad;
using grid::TileMask;

namespace {

constexpr Real kRestCells = Real(1e-4);  // cells per step: a tile is at rest below it, and what limits take no matter

// What one node or eight take from the hourglass part of a node field: what alternates from node to node along two axes
// or three. The divergence in the middle of a cell does not see it. Along each axis a field is smooth + alternating,
// (1 2 1)/4 + (-1 2 -1)/4; walls mirror it.
class Hourglass {
 public:
  Hourglass(const Grid& g, int j, int k) : g_(g) {
    const Around y = around(1, j), z = around(2, k);
    const std::size_t rows[3] = {y.lower, static_cast<std::size_t>(j), y.upper};
    const std::size_t slabs[3] = {z.lower, static_cast<std::size_t>(k), z.upper};
    for (std::size_t b = 0; b < 3; ++b)
      for (std::size_t a = 0; a < 3; ++a) row_[3 * b + a] = g.node_stride(1) * rows[a] + g.node_stride(2) * slabs[b];
  }
  // At node i of the row.
  EFSI_INLINE Quad part(const VectorField& field, int i) const {
    const Around x = around(0, i);
    return part<Quad>([&](std::size_t n) EFSI_INLINE_LAMBDA { return node_value(field, n); }, x.lower,
                      static_cast<std::size_t>(i), x.upper);
  }
  // At the nodes i to i + 7, none of them on a face.
  EFSI_INLINE Octet part(const std::vector<Real>& component, int i) const {
    const Real* p = component.data();
    const auto n = static_cast<std::size_t>(i);
    return part<Octet>([=](std::size_t m) EFSI_INLINE_LAMBDA { return grid::load_octet(p + m); }, n - 1, n, n + 1);
  }

 private:
  struct Around {
    std::size_t lower, upper;
  };
  Around around(int axis, int i) const {
    const auto a = static_cast<std::size_t>(axis);
    const int last = g_.cells[a];
    const int lower = i > 0 ? i - 1 : (g_.periodic[a] ? last - 1 : 1);
    const int upper = i < last ? i + 1 : (g_.periodic[a] ? 1 : last - 1);
    return {static_cast<std::size_t>(lower), static_cast<std::size_t>(upper)};
  }
  // Of the nine rows, from low to high along y, then z: the middle one, those beside it, those at the corners. What
  // alternates along y or z but not both, and along x not at all, and what alternates along none are smooth.
  template <class V, class Load>
  EFSI_INLINE V part(const Load& load, std::size_t before, std::size_t here, std::size_t after) const {
    const auto middle = [&](std::size_t i) EFSI_INLINE_LAMBDA { return load(row_[4] + i); };
    const auto corners = [&](std::size_t i) EFSI_INLINE_LAMBDA {
      return (load(row_[0] + i) + load(row_[2] + i)) + (load(row_[6] + i) + load(row_[8] + i));
    };
    const V m = middle(here), c = corners(here);
    const V edges = (load(row_[1] + here) + load(row_[7] + here)) + (load(row_[3] + here) + load(row_[5] + here));
    // smooth along y and z
    const V smooth = Real(0.0625) * c + (Real(0.125) * edges + Real(0.25) * m);
    // smooth along x and one of them, alternating along the other
    const V middle_x = Real(0.25) * (middle(before) + middle(after)) + Real(0.5) * m;
    const V corners_x = Real(0.25) * (corners(before) + corners(after)) + Real(0.5) * c;
    return m - smooth - (Real(0.5) * middle_x - Real(0.125) * corners_x);
  }

  const Grid& g_;
  std::size_t row_[9];
};

// Cells that a velocity goes in a step, at most 1.
EFSI_INLINE Real way(Real square, Real step) { return std::min(Real(1), step * std::sqrt(square)); }
EFSI_INLINE Octet way(const Octets& v, Real step) {
  Octet out = v.c[0] * v.c[0] + v.c[1] * v.c[1] + v.c[2] * v.c[2];
  for (int l = 0; l < kLanes; ++l) out[l] = way(out[l], step);
  return out;
}

// The velocity's transport over the nodes of one row.
struct Transport {
  NodeTransport nodes;
  Real step;
  const VectorField &flow, &carried;
  const Real* specific_volume;  // per node
  Real fluid_volume;
};

// The position from which a node is reached, relative to the node, by the midpoint rule. Where half the trace
// already leads through a wall it comes from the wall: the midpoint's velocity there, at a no-slip wall none, would
// keep a jet away from the wall where it is for ever.
EFSI_INLINE void carry_node(const Transport& t, const Row& row, int i, VectorField& first, VectorField& back) {
  const auto& sampler = t.nodes.sampler;
  const std::size_t n = row.first + static_cast<std::size_t>(i);
  const Quad node = {static_cast<Real>(i), static_cast<Real>(row.j), static_cast<Real>(row.k), 0};
  const Quad v = node_value(t.flow, n);
  const bool from_wall = sampler.cut_by_wall(node, node - Real(0.5) * t.step * v);
  const Quad from =
      sampler.keep_inside(from_wall ? node - t.step * v : sampler.trace_midpoint(t.flow, node, v, t.step));
  set_node(first, n, sampler.value(t.carried, from));
  set_node(back, n, from - node);
}

// The same for the nodes from i on. False: they have to be done one by one.
EFSI_INLINE bool carry_nodes(const Transport& t, const Row& row, int i, VectorField& first, VectorField& back) {
  const std::size_t n = row.first + static_cast<std::size_t>(i);
  const auto& lanes = t.nodes.lanes;
  const Octets half = scaled(grid::load_octets(t.flow, n), Real(-0.5) * t.step);
  const auto cuts = [&](const Octets& way)
                        EFSI_INLINE_LAMBDA { return Room(t.nodes.points, t.nodes.periodic, row, i).cuts(way); };
  grid::LaneSampler::Cell cell;
  Octets middle;
  if (lanes.place(i, row.j, row.k, half, cell)) {
    if (!cell.inner && cuts(half)) return false;
    middle = lanes.value(t.flow, n, cell);
    const Octets from = scaled(middle, -t.step);
    if (lanes.place(i, row.j, row.k, from, cell)) {
      grid::store_octets(first, n, lanes.value(t.carried, n, cell));
      grid::store_octets(back, n, from);
      return true;
    }
  } else {
    grid::LaneSampler::Place at;
    if (cuts(half) || !lanes.place(i, row.j, row.k, half, at)) return false;
    middle = lanes.value(t.flow, n, at);
  }
  grid::LaneSampler::Place at;
  const Octets from = Room(t.nodes.points, t.nodes.periodic, row, i).keep(scaled(middle, -t.step));
  if (!lanes.place(i, row.j, row.k, from, at)) return false;
  grid::store_octets(first, n, lanes.value(t.carried, n, at));
  grid::store_octets(back, n, from);
  return true;
}

void limit_at_border(const Transport& t, const Quad& from, Quad& v) {
  v = t.nodes.sampler.limit_at_border(t.carried, from, v);
}

// v limited to the range of the values around the place it comes from. At the border of a cell, and so on all nodes of
// fluid that moves along an axis, the range of one cell would be that of a side.
EFSI_INLINE Quad limited(const Transport& t, const Quad& from, Quad v) {
  const Quad inside = t.nodes.sampler.limit(t.carried, t.nodes.sampler.place(from), v);
  const Quad cut = inside - v;
  const auto counts = cut * cut > kRestCells * kRestCells / (t.step * t.step);
  if ((counts[0] | counts[1] | counts[2]) == 0) return inside;
  limit_at_border(t, from, v);
  return v;
}

// Takes half the error of going there and back off what arrives at a node, and of its hourglass part as much as the
// flow moves on in cells: nothing else resists it.
EFSI_INLINE Quad corrected_node(const Transport& t, const Row& row, const Hourglass& hourglass, int i,
                                const VectorField& first, const VectorField& back) {
  const auto& sampler = t.nodes.sampler;
  const std::size_t n = row.first + static_cast<std::size_t>(i);
  Quad w = node_value(first, n);
  if (t.specific_volume[n] != t.fluid_volume) return w;  // beside a solid: first order
  const Quad node = {static_cast<Real>(i), static_cast<Real>(row.j), static_cast<Real>(row.k), 0};
  const Quad v = node_value(t.flow, n), behind = node_value(back, n), from = node + behind;
  const Quad to = sampler.keep_inside(node + opposite(behind, v, t.step));
  if (!sampler.cut_by_wall(node, from) && !sampler.cut_by_wall(node, to)) {
    w = w + Real(0.5) * (node_value(t.carried, n) - sampler.value(first, to));
    w = limited(t, from, w);  // no new extremes
  }
  const Quad square = v * v;
  return w - way(square[0] + square[1] + square[2], t.step) * hourglass.part(first, i);
}

// The same for some of the nodes from i on: few, and seldom.
[[gnu::noinline]] void correct_some(const Transport& t, const Row& row, const Hourglass& hourglass, int i,
                                    const VectorField& first, const VectorField& back, const grid::OctetMask& which,
                                    Octets& w) {
  for (int l = 0; l < kLanes; ++l) {
    if (!which[l]) continue;
    const Quad one = corrected_node(t, row, hourglass, i + l, first, back);
    for (int a = 0; a < 3; ++a) w.c[a][l] = one[a];
  }
}

// The same for the nodes from i on. False: they have to be done one by one.
EFSI_INLINE bool corrected_nodes(const Transport& t, const Row& row, const Hourglass& hourglass, int i,
                                 const VectorField& first, const VectorField& back, Octets& w) {
  const std::size_t n = row.first + static_cast<std::size_t>(i);
  const auto& lanes = t.nodes.lanes;
  const Octet zero{}, least = grid::octet(kRestCells / t.step);
  const auto fluid = grid::load_octet(t.specific_volume + n) == grid::octet(t.fluid_volume);
  // Displacements of the backward and the forward trace; nodes without fluid stay.
  const Octets v = grid::load_octets(t.flow, n), whole = grid::load_octets(t.carried, n);
  Octets from = grid::load_octets(back, n), to;
  for (std::size_t a = 0; a < 3; ++a) {
    to.c[a] = fluid ? opposite(from.c[a], v.c[a], t.step) : zero;
    from.c[a] = fluid ? from.c[a] : zero;
  }
  // The limited correction, less hourglass modes.
  const auto correct = [&](const auto& ahead, const auto& behind) EFSI_INLINE_LAMBDA {
    const Octet share = way(v, t.step);
    Octet cut{};  // what the limits take, largest component
#pragma GCC unroll 3
    for (std::size_t a = 0; a < 3; ++a) {
      const Real* arrived = first.c[a].data() + n;
      const Octet here = grid::load_octet(arrived);
      const Octet better = here + Real(0.5) * (whole.c[a] - lanes.value(arrived, ahead));
      const Octet limited = lanes.limit(t.carried.c[a].data() + n, behind, better);
      cut = grid::larger(cut, grid::larger(limited - better, better - limited));
      w.c[a] = fluid ? limited - share * hourglass.part(first.c[a], i) : here;
    }
    const auto counts = fluid & (cut > least);
    if (!grid::any(counts)) return;
    const auto redo = counts & lanes.at_border(behind);
    if (grid::any(redo)) correct_some(t, row, hourglass, i, first, back, redo, w);
  };
  const auto cuts = [&]() EFSI_INLINE_LAMBDA {
    const Room room(t.nodes.points, t.nodes.periodic, row, i);
    return room.cuts(from) || room.cuts(to);
  };
  // All eight within one cell, else within three taps, else the caller goes node by node.
  grid::LaneSampler::Cell to_cell, from_cell;
  if (lanes.place(i, row.j, row.k, to, to_cell) && lanes.place(i, row.j, row.k, from, from_cell)) {
    if ((!to_cell.inner || !from_cell.inner) && cuts()) return false;
    correct(to_cell, from_cell);
    return true;
  }
  grid::LaneSampler::Place ahead, behind;
  if (cuts()) return false;
  if (!lanes.place(i, row.j, row.k, to, ahead) || !lanes.place(i, row.j, row.k, from, behind)) return false;
  correct(ahead, behind);
  return true;
}

EFSI_KERNEL void carry_row(const Transport& t, const Row& row, VectorField& first, VectorField& back) {
  const auto one = [&](int i) EFSI_INLINE_LAMBDA { carry_node(t, row, i, first, back); };
  for_lanes(row, t.nodes.points[0] - 1, one, [&](int i, int) EFSI_INLINE_LAMBDA {
    if (carry_nodes(t, row, i, first, back)) return;
    for (int l = 0; l < kLanes; ++l) one(i + l);
  });
}

// result: in how far it is to where things come from.
EFSI_KERNEL void correct_row(const Grid& g, const Transport& t, const Row& row, const VectorField& first,
                             VectorField& result) {
  const Hourglass hourglass(g, row.j, row.k);
  const auto one = [&](int i) EFSI_INLINE_LAMBDA {
    set_node(result, row.first + static_cast<std::size_t>(i), corrected_node(t, row, hourglass, i, first, result));
  };
  for_lanes(row, t.nodes.points[0] - 1, one,
            [&](int i, int done) EFSI_INLINE_LAMBDA {  // the first `done` nodes come later
              Octets w;
              if (corrected_nodes(t, row, hourglass, i, first, result, w)) {
                for (std::size_t a = 0; a < 3; ++a)
                  store_from(done, w.c[a], result.c[a].data() + row.first + static_cast<std::size_t>(i));
                return;
              }
              for (int l = done; l < kLanes; ++l) one(i + l);
            });
}

// Largest component of a tile of the velocity.
EFSI_KERNEL Real top_of_tile(const Grid& g, const Vec3i& begin, const Vec3i& end, const VectorField& velocity) {
  Real top = 0;
  Octet tops{};
  for (const auto& component : velocity.c)
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j) {
        const Real* row = component.data() + g.node(begin[0], j, k);
        if (end[0] - begin[0] == kLanes) {
          const Octet v = grid::load_octet(row);
          tops = grid::larger(tops, grid::larger(v, -v));
        } else {
          for (int i = 0; i < end[0] - begin[0]; ++i) top = std::max(top, std::abs(row[i]));
        }
      }
  return std::max(top, grid::greatest(tops));
}

void copy_row(const Row& row, const VectorField& from, VectorField& to) {
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t n = row.first + static_cast<std::size_t>(row.begin);
    std::copy_n(from.c[a].data() + n, row.end - row.begin, to.c[a].data() + n);
  }
}

}  // namespace

std::uint64_t advect_velocity(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                              const VectorField& flow, const VectorField& carried,
                              const std::vector<Real>& specific_volume, Real fluid_volume, FluidState& state,
                              AdvectWorkspace& work) {
  const Transport t = {NodeTransport(g), static_cast<Real>(dt / g.h), flow,
                       carried,          specific_volume.data(),      fluid_volume};
  TileMask tiles(g.nodes());
  parallel.for_each(tiles.count(), [&](std::int64_t tile) {
    Vec3i begin, end;
    tiles.range(tile, begin, end);
    tiles.set(tile, top_of_tile(g, begin, end, flow) * t.step > kRestCells);
  });
  tiles.dilate(g.periodic);

  VectorField &first = work.first, &result = state.velocity;
  for (std::size_t a = 0; a < 3; ++a) {
    first.c[a].resize(g.node_count());
    result.c[a].resize(g.node_count());
  }
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    const Row row = {j, k, begin, end, g.node(0, j, k)};
    if (active)
      carry_row(t, row, first, result);
    else
      copy_row(row, carried, first);
  });
  tiles.for_runs(parallel, [&](int j, int k, int begin, int end, bool active) {
    const Row row = {j, k, begin, end, g.node(0, j, k)};
    if (active && corrected)
      correct_row(g, t, row, first, result);
    else
      copy_row(row, first, result);
  });
  return tiles.active_count();
}

}  // namespace efsi::fluid
