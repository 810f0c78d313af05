#include "system/solid_lattice.hpp"

#include "solid/stiffness_block.hpp"
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

// Calls body(index of the box's node) for the corners at `at` + {0, 1}^3 * step that lie in the box.
template <class Body>
void for_corners(const SolidLattice& lattice, const Box& box, const Vec3i& at, int step, const Body& body) {
  for (const auto& c : grid::kCorner) {
    const Vec3i corner{at[0] + step * c[0], at[1] + step * c[1], at[2] + step * c[2]};
    if (SolidLattice::inside(box, corner)) body(lattice.index(box, corner));
  }
}

// Calls body(child, weight) for the nodes of the finer lattice that have a part of their values from node `at` of the
// coarser one.
template <class Body>
void for_children(const SolidLattice& fine, std::size_t b, const Vec3i& at, const Body& body) {
  const Box& box = fine.boxes[b];
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const Vec3i child{2 * at[0] + x, 2 * at[1] + y, 2 * at[2] + z};
        if (!SolidLattice::inside(box, child)) continue;
        const std::int32_t id = fine.id[fine.index(box, child)];
        if (id >= 0) body(id, Real(1) / static_cast<Real>(1 << (x * x + y * y + z * z)));
      }
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
  parallel.for_each(row_count, [&](std::int64_t r) {
    const auto& [b, j, k] = rows[static_cast<std::size_t>(r)];
    const Box& box = coarse.boxes[b];
    for (int i = 0; i < box.nodes[0]; ++i) {
      const std::size_t cell = coarse.index(box, {i, j, k});
      for_corners(fine, fine.boxes[b], {2 * i, 2 * j, 2 * k}, 1, [&](std::size_t part) {
        coarse.carries[cell] |= fine.carries[part];
        coarse.lambda[cell] += fine.lambda[part];
        coarse.mu[cell] += fine.mu[part];
      });
    }
  });
  std::vector<std::int32_t> begin(rows.size() + 1, 0);
  parallel.for_each(row_count, [&](std::int64_t r) {
    const auto& [b, j, k] = rows[static_cast<std::size_t>(r)];
    const Box& box = coarse.boxes[b];
    std::int32_t& count = begin[static_cast<std::size_t>(r) + 1];
    for (int i = 0; i < box.nodes[0]; ++i) {
      bool corner = false;
      for_corners(coarse, box, {i, j, k}, -1, [&](std::size_t cell) { corner = corner || coarse.carries[cell]; });
      if (corner) coarse.id[coarse.index(box, {i, j, k})] = count++;
    }
  });
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

// The coarse nodes that a finer node lies between: two along each axis where its place is odd.
void find_parents(const Parallel& parallel, const SolidLattice& fine, const SolidLattice& coarse, Interpolation& from) {
  from.parent_begin.assign(fine.size() + 1, 0);
  const auto nodes = static_cast<std::int64_t>(fine.size());
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto& [b, at] = fine.place[static_cast<std::size_t>(n)];
    const bool has_box = coarse.boxes[b].nodes[0] > 0;
    from.parent_begin[static_cast<std::size_t>(n) + 1] = has_box ? 1 << ((at[0] & 1) + (at[1] & 1) + (at[2] & 1)) : 0;
  });
  sum_up(from.parent_begin);
  from.parent.resize(static_cast<std::size_t>(from.parent_begin.back()));
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto& [b, at] = fine.place[static_cast<std::size_t>(n)];
    const Box& box = coarse.boxes[b];
    if (box.nodes[0] == 0) return;
    auto next = static_cast<std::size_t>(from.parent_begin[static_cast<std::size_t>(n)]);
    for (const auto& c : grid::kCorner)
      if (c[0] <= (at[0] & 1) && c[1] <= (at[1] & 1) && c[2] <= (at[2] & 1))
        from.parent[next++] = coarse.id[coarse.index(box, {at[0] / 2 + c[0], at[1] / 2 + c[1], at[2] / 2 + c[2]})];
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
  from.weight.resize(from.child.size());
  coarse.mass.assign(coarse.size(), 0.0);
  coarse.moves.assign(coarse.size(), 0);
  parallel.for_each(nodes, [&](std::int64_t n) {
    const auto u = static_cast<std::size_t>(n);
    const auto& [b, at] = coarse.place[u];
    auto next = static_cast<std::size_t>(from.child_begin[u]);
    for_children(fine, b, at, [&](std::int32_t child, Real weight) {
      from.child[next] = child;
      from.weight[next++] = weight;
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
    const Real factor = system.stiffness_factor(l);
    parallel.for_each(static_cast<std::int64_t>(work.blocks()), [&](std::int64_t n) {
      const std::size_t block = static_cast<std::size_t>(n), first = block * solid::kBlock;
      const solid::BlockModuli moduli = solid::block_moduli(work, block);
      for (std::size_t e = first; e < std::min(first + solid::kBlock, work.element_cell.size()); ++e) {
        const std::size_t node = box.first + static_cast<std::size_t>(work.element_corner[e]);
        lattice.carries[node] = 1;
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
    for (std::size_t a = 0; a < 3; ++a) half.nodes[a] = box.nodes[a] / 2 + 1;
  }
  place_boxes(coarse);
  fill_boxes(parallel, fine, coarse);
  find_parents(parallel, fine, coarse, from);
  find_children(parallel, fine, coarse, from);
  return coarse;
}

}  // namespace efsi::system
