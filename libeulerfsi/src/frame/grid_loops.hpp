// Purpose: loops over the parts of the common grid with solids or walls; planes in parallel.
#pragma once

#include <algorithm>

#include "base/parallel.hpp"
#include "grid/grid.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

// Calls body(i, j, k) for the places of `common`, up to `end` beyond its last cell, that a solid's band has too; planes
// in parallel.
template <class Body>
void for_shared_places(const Parallel& parallel, const grid::Grid& common, const grid::Grid& band, int end,
                       const Body& body) {
  const Vec3i lo = grid::offset(band, common);
  Vec3i first, last;
  for (std::size_t a = 0; a < 3; ++a) {
    first[a] = std::max(0, lo[a]);
    last[a] = std::min(common.cells[a], lo[a] + band.cells[a]) + end;
  }
  parallel.for_each(std::max(0, last[2] - first[2]), [&](std::int64_t plane) {
    const int k = first[2] + static_cast<int>(plane);
    for (int j = first[1]; j < last[1]; ++j)
      for (int i = first[0]; i < last[0]; ++i) body(i, j, k);
  });
}

// Calls body(band cell or node index, i, j, k of the common grid) for what both have.
template <class Body>
void for_band_nodes(const Parallel& parallel, const grid::Grid& common, const solid::Band& band, const Body& body) {
  const Vec3i lo = grid::offset(band.grid, common);
  for_shared_places(parallel, common, band.grid, 1,
                    [&](int i, int j, int k) { body(band.grid.node(i - lo[0], j - lo[1], k - lo[2]), i, j, k); });
}

template <class Body>
void for_band_cells(const Parallel& parallel, const grid::Grid& common, const solid::Band& band, const Body& body) {
  const Vec3i lo = grid::offset(band.grid, common);
  for_shared_places(parallel, common, band.grid, 0,
                    [&](int i, int j, int k) { body(band.grid.cell(i - lo[0], j - lo[1], k - lo[2]), i, j, k); });
}

// Calls body(padded cell of the common grid, band cell) for the cells that solid l owns (Matter.owned).
template <class Body>
void for_owned_cells(const Parallel& parallel, const grid::Grid& common, const std::vector<std::uint8_t>& owned,
                     std::size_t l, const solid::Band& band, const Body& body) {
  for_band_cells(parallel, common, band, [&](std::size_t c, int i, int j, int k) {
    const std::size_t cell = common.padded(i, j, k);
    if (owned[cell] == l + 1) body(cell, c);
  });
}

// Cells of a grid that touch a node.
inline int adjacent_cells(const grid::Grid& g, int i, int j, int k) {
  const int index[3] = {i, j, k};
  int cells = 1;
  for (std::size_t a = 0; a < 3; ++a) cells *= g.periodic[a] || (index[a] > 0 && index[a] < g.cells[a]) ? 2 : 1;
  return cells;
}

// The cells of a grid around a node that have this owner (Matter.owned), bits as in system::SlipNode.
inline std::uint8_t cells_owned_by(const grid::Grid& g, const std::vector<std::uint8_t>& owned, std::size_t owner,
                                   int i, int j, int k) {
  std::uint8_t cells = 0;
  for (std::size_t a = 0; a < 8; ++a) {
    const auto& c = grid::kCorner[a];
    const Vec3i q{i - c[0], j - c[1], k - c[2]};
    bool inside = true;
    for (std::size_t x = 0; x < 3; ++x) inside = inside && q[x] >= 0 && q[x] < g.cells[x];
    if (inside && owned[g.padded(q[0], q[1], q[2])] == owner) cells = static_cast<std::uint8_t>(cells | (1u << a));
  }
  return cells;
}

// Calls body(node, i, j, k) for the nodes on the faces of a grid.
template <class Body>
void for_face_nodes(const Parallel& parallel, const grid::Grid& g, const Body& body) {
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j) {
      const bool face = k == 0 || j == 0 || k == g.cells[2] || j == g.cells[1];
      for (int i = 0; i <= g.cells[0]; i += face ? 1 : g.cells[0]) body(g.node(i, j, k), i, j, k);
    }
  });
}

}  // namespace efsi::sim
