// Purpose: the elements beside a cell.
#pragma once

#include <algorithm>
#include <cstdlib>

#include "solid/solid.hpp"

namespace efsi::solid {

// Calls visit(e, place) for the elements of cells that differ from this one by one along so many axes, in the order of
// their cells; 1: over its faces, 2: its edges, 3: its corners. place: of the element's cell.
template <class Visit>
void visit_beside(const grid::Grid& g, const SolidWork& work, const Vec3i& cell, int axes, const Visit& visit) {
  for (int k = std::max(cell[2] - 1, 0); k <= std::min(cell[2] + 1, g.cells[2] - 1); ++k)
    for (int j = std::max(cell[1] - 1, 0); j <= std::min(cell[1] + 1, g.cells[1] - 1); ++j)
      for (int i = std::max(cell[0] - 1, 0); i <= std::min(cell[0] + 1, g.cells[0] - 1); ++i) {
        if (std::abs(i - cell[0]) + std::abs(j - cell[1]) + std::abs(k - cell[2]) != axes) continue;
        const std::int32_t e = work.element[g.cell(i, j, k)];
        if (e >= 0) visit(static_cast<std::size_t>(e), Vec3i{i, j, k});
      }
}

}  // namespace efsi::solid
