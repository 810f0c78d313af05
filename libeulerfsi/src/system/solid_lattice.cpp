#include "system/solid_lattice.hpp"

#include <array>

#include "solid/element/stiffness_block.hpp"
#include "system/velocity_system.hpp"

namespace efsi::system {
namespace {

using Box = SolidLattice::Box;

// A row of nodes along x.
struct Row {
  std::size_t box;
  int j, k;
};

std::vector<Row> rows_of(const SolidLattice& lattice) {
  std::vector<Row> rows;
  for (std::size_t b = 0; b < lattice.boxes.size(); ++b)
    for (int k = 0; k < lattice.boxes[b].nodes[2]; ++k)
      for (int j = 0; j < lattice.boxes[b].nodes[1]; ++j) rows.push_back({b, j, k});
  return rows;
}

// Weights of the nodes of the next coarser lattice at a finer node along an axis, or of the finer ones at a coarser
// node: from place `first` on.
struct Weights {
  int first = 0, count = 0;
  std::array<Real, 4> weight{};
};

bool is_odd(const Box& fine, std::size_t axis) { return fine.nodes[axis] % 2 == 0; }  // number of cells

Weights parents_along(const Box& fine, std::size_t axis, int at) {
  const bool second = at % 2 != 0;
  if (is_odd(fine, axis)) return {at / 2, 2, {second ? Real(0.25) : Real(0.75), second ? Real(0.75) : Real(0.25)}};
  return {at / 2, second ? 2 : 1, {second ? Real(0.5) : Real(1), Real(0.5)}};
}

Weights children_along(const Box& fine, std::size_t axis, int at) {
  if (is_odd(fine, axis)) return {2 * at - 2, 4, {Real(0.25), Real(0.75), Real(0.75), Real(0.25)}};
  return {2 * at - 1, 3, {Real(0.5), Real(1), Real(0.5)}};
}

// Parts of finer cells that lie in a coarser one.
Weights cells_along(const Box& fine, std::size_t axis, int at) {
  if (is_odd(fine, axis)) return {2 * at - 1, 3, {Real(0.5), Real(1), Real(0.5)}};
  return {2 * at, 2, {Real(1), Real(1)}};
}

// Calls body(place, weight) for all that the weights along the axes name.
template <class Along, class Body>
void for_weights(const Along& along, const Box& fine, const Vec3i& at, const Body& body) {
  const Weights x = along(fine, 0, at[0]), y = along(fine, 1, at[1]), z = along(fine, 2, at[2]);
  for (int k = 0; k < z.count; ++k)
    for (int j = 0; j < y.count; ++j)
      for (int i = 0; i < x.count; ++i)
        body(Vec3i{x.first + i, y.first + j, z.first + k}, x.weight[static_cast<std::size_t>(i)] *
                                                               y.weight[static_cast<std::size_t>(j)] *
                                                               z.weight[static_cast<std::size_t>(k)]);
}

// Calls body(child, weight) for the nodes of the finer lattice that have a part of their values from node `at` of the
// coarser one.
template <class Body>
void for_children(const SolidLattice& fine, std::size_t b, const Vec3i& at, const Body& body) {
  const Box& box = fine.boxes[b];
  for_weights(children_along, box, at, [&](const Vec3i& child, Real weight) {
    if (!SolidLattice::inside(box, child)) return;
    const std::int32_t id = fine.id[fine.index(box, child)];
    if (id >= 0) body(id, weight);
  });
}

void sum_up(std::vector<std::int32_t>& begin) {
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
}

void place_boxes(SolidLattice& lattice) {
  std::size_t size = 0;
  for (Box& box : lattice.boxes) {
    box.first = size;
    size += static_cast<std::size_t>(box.nodes[0]) * static_cast<std::size_t>(box.nodes[1]) *
            static_cast<std::size_t>(box.nodes[2]);
  }
  lattice.id.assign(size, -1);
  lattice.carries.assign(size, 0);
  lattice.lambda.assign(size, 0);
  lattice.mu.assign(size, 0);
}

// What the cells hold, and the nodes at their corners.
void fill_boxes(const Parallel& parallel, const SolidLattice& fine, SolidLattice& coarse) {
  const std::vector<Row> rows = rows_of(coarse);
  const auto row_count = static_cast<std::int64_t>(rows.size());
  // Moduli of the coarse cells.
  parallel.for_each(row_count, [&](std::int64_t r) {
    const auto& [b, j, k] = rows[static_cast<std::size_t>(r)];
    const Box& box = coarse.boxes[b];
    for (int i = 0; i < box.nodes[0]; ++i) {
      const std::size_t cell = coarse.index(box, {i, j, k});
      for_weights(cells_along, fine.boxes[b], {i, j, k}, [&](const Vec3i& at, Real weight) {
        if (!SolidLattice::inside(fine.boxes[b], at)) return;
        const std::size_t part = fine.index(fine.boxes[b], at);
        coarse.carries[cell] |= fine.carries[part];
        coarse.lambda[cell] += weight * fine.lambda[part];
        coarse.mu[cell] += weight * fine.mu[part];
      });
    }
  });
  // Nodes at corners of cells with stiffness, numbered per row,
  std::vector<std::int32_t> begin(rows.size() + 1, 0);
  parallel.for_each(row_count, [&](std::int64_t r) {
    const auto& [b, j, k] = rows[static_cast<std::size_t>(r)];
    const Box& box = coarse.boxes[b];
    std::int32_t& count = begin[static_cast<std::size_t>(r) + 1];
    for (int i = 0; i < box.nodes[0]; ++i) {
      bool corner = false;
      for (const auto& c : grid::kCorner) {
        const Vec3i cell{i - c[0], j - c[1], k - c[2]};
        corner = corner || (SolidLattice::inside(box, cell) && coarse.carries[coarse.index(box, cell)]);
      }
      if (corner) coarse.id[coarse.index(box, {i, j, k})] = count++;
    }
  });
  // then over all rows.
  sum_up(begin);
  coarse.place.resize(static_cast<std::size_t>(begin.back()));
  parallel.for_each(row_count, [&](std::int64_t r) {
    const auto& [b, j, k] = rows[static_cast<std::size_t>(r)];
    const Box& box = coarse.boxes[b];
    for (int i = 0; i < box.nodes[0]; ++i) {
      std::int32_t& id = coarse.id[coarse.index(box, {i, j, k})];
      if (id < 0) continue;
      id += begin[static_cast<std::size_t>(r)];
      coarse.place[static_cast<std::size_t>(id)] = {b, {i, j, k}};
    }
  });
}

// The coarse nodes that a finer node lies between.
void find_parents(const Parallel& parallel, const SolidLattice& fine, const SolidLattice& coarse, Interpolation& from) {
  from.parent_begin.assign(fine.size() + 1, 0);
  const auto nodes = static_cast<std::int64_t>(fine.size());
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto& [b, at] = fine.place[static_cast<std::size_t>(n)];
    if (coarse.boxes[b].nodes[0] == 0) return;
    std::int32_t& count = from.parent_begin[static_cast<std::size_t>(n) + 1];
    for_weights(parents_along, fine.boxes[b], at, [&](const Vec3i&, Real) { ++count; });
  });
  sum_up(from.parent_begin);
  from.parent.resize(static_cast<std::size_t>(from.parent_begin.back()));
  from.parent_weight.resize(from.parent.size());
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto& [b, at] = fine.place[static_cast<std::size_t>(n)];
    const Box& box = coarse.boxes[b];
    if (box.nodes[0] == 0) return;
    auto next = static_cast<std::size_t>(from.parent_begin[static_cast<std::size_t>(n)]);
    for_weights(parents_along, fine.boxes[b], at, [&](const Vec3i& place, Real weight) {
      from.parent[next] = coarse.id[coarse.index(box, place)];
      from.parent_weight[next++] = weight;
    });
  });
}

// The same the other way round, and what coarse nodes have of their children: mass, and whether they move.
void find_children(const Parallel& parallel, const SolidLattice& fine, SolidLattice& coarse, Interpolation& from) {
  from.child_begin.assign(coarse.size() + 1, 0);
  const auto nodes = static_cast<std::int64_t>(coarse.size());
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto& [b, at] = coarse.place[static_cast<std::size_t>(n)];
    for_children(fine, b, at, [&](std::int32_t, Real) { ++from.child_begin[static_cast<std::size_t>(n) + 1]; });
  });
  sum_up(from.child_begin);
  from.child.resize(static_cast<std::size_t>(from.child_begin.back()));
  from.child_weight.resize(from.child.size());
  coarse.mass.assign(coarse.size(), 0.0);
  coarse.moves.assign(coarse.size(), 0);
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto u = static_cast<std::size_t>(n);
    const auto& [b, at] = coarse.place[u];
    auto next = static_cast<std::size_t>(from.child_begin[u]);
    for_children(fine, b, at, [&](std::int32_t child, Real weight) {
      from.child[next] = child;
      from.child_weight[next++] = weight;
      coarse.mass[u] += static_cast<double>(weight) * fine.mass[static_cast<std::size_t>(child)];
      coarse.moves[u] |= fine.moves[static_cast<std::size_t>(child)];
    });
  });
}

}  // namespace

SolidLattice finest_lattice(const Parallel& parallel, const VelocitySystem& system,
                            const std::vector<std::uint8_t>& wanted) {
  SolidLattice lattice;
  lattice.h = system.cell();
  // The boxes are the bands of the solids.
  lattice.boxes.resize(system.solids());
  for (std::size_t l = 0; l < system.solids(); ++l)
    if (wanted[l]) lattice.boxes[l].nodes = system.solid(l).state->band.grid.nodes();
  place_boxes(lattice);
  const auto unknowns = static_cast<std::size_t>(system.unknowns());
  lattice.place.resize(unknowns);
  lattice.mass.resize(unknowns);
  lattice.moves.resize(unknowns);
  for (std::size_t l = 0; l < system.solids(); ++l) {
    const solid::SolidWork& work = *system.solid(l).work;
    const grid::Grid& band = system.solid(l).state->band.grid;
    const Vec3i lo = grid::offset(band, system.grid());
    const Box& box = lattice.boxes[l];
    // Unknowns: place, mass and free components.
    const std::size_t begin = system.begin_of(l);
    parallel.for_each(static_cast<std::int64_t>(system.begin_of(l + 1) - begin), [&](std::int64_t n) {
      const std::size_t u = begin + static_cast<std::size_t>(n);
      const Vec3i node = system.grid().node_place(system.nodes()[u]);
      const Vec3i at{node[0] - lo[0], node[1] - lo[1], node[2] - lo[2]};
      lattice.place[u] = {l, at};
      lattice.mass[u] = system.inertia(u);
      for (unsigned a = 0; a < 3; ++a)
        if (system.free()[3 * u + a] > 0) lattice.moves[u] = static_cast<std::uint8_t>(lattice.moves[u] | 1u << a);
      if (wanted[l]) lattice.id[lattice.index(box, at)] = static_cast<std::int32_t>(u);
    });
    if (!wanted[l]) continue;
    // Elements: moduli.
    parallel.for_each(static_cast<std::int64_t>(work.blocks()), [&](std::int64_t n) {
      const std::size_t block = static_cast<std::size_t>(n), first = block * solid::kBlock;
      const solid::BlockModuli moduli = solid::block_moduli(work, block);
      for (std::size_t e = first; e < std::min(first + solid::kBlock, work.element_cell.size()); ++e) {
        const std::size_t node = box.first + static_cast<std::size_t>(work.element_corner[e]);
        lattice.carries[node] = 1;
        const Real factor = system.stiffness_factor(l, e);
        lattice.lambda[node] = factor * moduli.lambda[e - first];
        lattice.mu[node] = factor * moduli.mu[e - first];
      }
    });
  }
  return lattice;
}

SolidLattice coarsen(const Parallel& parallel, const SolidLattice& fine, Interpolation& from) {
  SolidLattice coarse;
  coarse.h = 2.0 * fine.h;
  for (const Box& box : fine.boxes) {
    Box& half = coarse.boxes.emplace_back();
    if (box.nodes[0] == 0) continue;
    for (std::size_t a = 0; a < 3; ++a) half.nodes[a] = box.nodes[a] / 2 + 1;  // cells n / 2 or (n + 1) / 2
  }
  place_boxes(coarse);
  fill_boxes(parallel, fine, coarse);
  find_parents(parallel, fine, coarse, from);
  find_children(parallel, fine, coarse, from);
  return coarse;
}

}  // namespace efsi::system
