#include "solid/element/aggregation.hpp"

#include <algorithm>
#include <cstdlib>

namespace efsi::solid {
namespace {

using grid::Grid;

// The elements of cells that differ from this one by one along so many axes: 1: over its faces, 2: its edges, 3: its
// corners.
void find_beside(const Grid& g, const SolidWork& work, const Vec3i& cell, int axes, std::vector<std::size_t>& beside) {
  for (int k = std::max(cell[2] - 1, 0); k <= std::min(cell[2] + 1, g.cells[2] - 1); ++k)
    for (int j = std::max(cell[1] - 1, 0); j <= std::min(cell[1] + 1, g.cells[1] - 1); ++j)
      for (int i = std::max(cell[0] - 1, 0); i <= std::min(cell[0] + 1, g.cells[0] - 1); ++i) {
        if (std::abs(i - cell[0]) + std::abs(j - cell[1]) + std::abs(k - cell[2]) != axes) continue;
        const std::int32_t e = work.element[g.cell(i, j, k)];
        if (e >= 0) beside.push_back(static_cast<std::size_t>(e));
      }
}

}  // namespace

void stiffen_beside_cuts(const Grid& g, SolidWork& work) {
  if (work.element_factor.empty()) return;
  std::vector<std::size_t> beside;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k);
        if (work.element[c] >= 0 || !(work.fraction[c] > 0)) continue;
        beside.clear();
        for (int axes = 1; axes <= 3 && beside.empty(); ++axes) find_beside(g, work, {i, j, k}, axes, beside);
        const double part = static_cast<double>(work.fraction[c]) / static_cast<double>(work.volume_ratio[c]) /
                            static_cast<double>(beside.size());
        for (const std::size_t e : beside)
          work.element_factor[e] +=
              part * static_cast<double>(work.volume_ratio[static_cast<std::size_t>(work.element_cell[e])]);
      }
}

}  // namespace efsi::solid
