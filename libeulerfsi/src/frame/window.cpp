#include "frame/window.hpp"

#include <algorithm>

namespace efsi::sim {

using grid::Grid;

namespace {

// Cells of the box from begin to end, over all elements; begin beyond end where there are none.
void bound_elements(const Grid& box, const std::vector<solid::SolidState>& solids,
                    const std::vector<solid::SolidWork>& work, Vec3i& begin, Vec3i& end) {
  begin = box.cells;
  end = {0, 0, 0};
  for (std::size_t l = 0; l < solids.size(); ++l) {
    const Grid& band = solids[l].band.grid;
    for (const std::int32_t cell : work[l].element_cell) {
      const int nx = band.cells[0], ny = band.cells[1];
      const Vec3i at = {cell % nx, cell / nx % ny, cell / (nx * ny)};
      for (std::size_t a = 0; a < 3; ++a) {
        begin[a] = std::min(begin[a], at[a] + band.lo[a]);
        end[a] = std::max(end[a], at[a] + band.lo[a] + 1);
      }
    }
  }
}

Grid grid_of(const Window& window) {
  Grid g;
  g.cells = window.cells;
  return g;
}

}  // namespace

Window choose_window(const Params& params, const Grid& box, const std::vector<solid::SolidState>& solids,
                     const std::vector<solid::SolidWork>& work) {
  Window window{{0, 0, 0}, box.cells};
  if (params.fluid.present) return window;
  Vec3i begin, end;
  bound_elements(box, solids, work, begin, end);
  for (std::size_t a = 0; a < 3; ++a) {
    if (box.periodic[a]) continue;
    const int lo = std::max(0, std::min(begin[a], end[a]) - kWindowMargin);
    const int wanted = std::max(1, end[a] + kWindowMargin - lo);
    const int rounded = (wanted + kWindowStep - 1) / kWindowStep * kWindowStep;
    window.lo[a] = lo;
    window.cells[a] = std::min(rounded, box.cells[a] - lo);
  }
  return window;
}

CommonGrid cut(const Params& params, const Grid& box, const Window& window) {
  CommonGrid common{box, params.walls};
  common.grid.lo = window.lo;
  common.grid.cells = window.cells;
  common.grid.origin = box.node_position(window.lo[0], window.lo[1], window.lo[2]);
  for (std::size_t a = 0; a < 3; ++a) {
    if (window.lo[a] > 0) common.walls.face[2 * a] = grid::Wall::kOpen;
    if (window.lo[a] + window.cells[a] < box.cells[a]) common.walls.face[2 * a + 1] = grid::Wall::kOpen;
  }
  return common;
}

std::vector<Real> move_cells(const std::vector<Real>& values, const Window& from, const Window& to) {
  const Grid old = grid_of(from), next = grid_of(to);
  std::vector<Real> moved(next.padded_count(), 0);
  Vec3i begin, end;  // cells of the box that both have
  for (std::size_t a = 0; a < 3; ++a) {
    begin[a] = std::max(from.lo[a], to.lo[a]);
    end[a] = std::min(from.lo[a] + from.cells[a], to.lo[a] + to.cells[a]);
    if (begin[a] >= end[a]) return moved;
  }
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j)
      std::copy_n(values.data() + old.padded(begin[0] - from.lo[0], j - from.lo[1], k - from.lo[2]), end[0] - begin[0],
                  moved.data() + next.padded(begin[0] - to.lo[0], j - to.lo[1], k - to.lo[2]));
  return moved;
}

}  // namespace efsi::sim
