#include "solid/element/aggregation.hpp"

#include "solid/element/beside.hpp"

namespace efsi::solid {

using grid::Grid;

void stiffen_beside_cuts(const Grid& g, SolidWork& work) {
  if (work.element_factor.empty()) return;
  std::vector<std::size_t> beside;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k);
        if (work.element[c] >= 0 || !(work.fraction[c] > 0)) continue;
        beside.clear();
        for (int axes = 1; axes <= 3 && beside.empty(); ++axes)
          visit_beside(g, work, {i, j, k}, axes, [&](std::size_t e, const Vec3i&) { beside.push_back(e); });
        const double part = static_cast<double>(work.fraction[c]) / static_cast<double>(work.volume_ratio[c]) /
                            static_cast<double>(beside.size());
        for (const std::size_t e : beside)
          work.element_factor[e] +=
              part * static_cast<double>(work.volume_ratio[static_cast<std::size_t>(work.element_cell[e])]);
      }
}

}  // namespace efsi::solid
