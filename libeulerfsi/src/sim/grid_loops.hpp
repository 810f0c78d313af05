// Purpose: loops over the parts of the common grid that solids or walls hold; planes in parallel.
#pragma once

#include "sim/workspace.hpp"

namespace efsi::sim {

// Calls body(band cell or node index, i, j, k of the global grid) for a solid's band.
template <class Body>
void for_band_nodes(const Parallel& parallel, const solid::Band& band, const Body& body) {
  const grid::Grid& g = band.grid;
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) body(g.node(i, j, k), i + band.lo[0], j + band.lo[1], k + band.lo[2]);
  });
}

template <class Body>
void for_band_cells(const Parallel& parallel, const solid::Band& band, const Body& body) {
  const grid::Grid& g = band.grid;
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) body(g.cell(i, j, k), i + band.lo[0], j + band.lo[1], k + band.lo[2]);
  });
}

// Calls body(padded cell) for the cells that a solid owns.
template <class Body>
void for_owned_cells(const Parallel& parallel, const Scene& scene, const State& state, const Workspace& work,
                     std::size_t l, const Body& body) {
  for_band_cells(parallel, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
    if (work.solids[l].element[c] >= 0) body(scene.grid.padded(i, j, k));
  });
}

// Calls body(node, i, j, k) for the nodes on the faces of the box.
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
