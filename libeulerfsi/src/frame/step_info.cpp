#include "frame/step_info.hpp"

#include <algorithm>
#include <cmath>

#include "base/kernel.hpp"

namespace efsi::sim {
namespace {

EFSI_KERNEL Real largest(std::size_t n, const Real* values) {
  Real top = 0;
#pragma omp simd reduction(max : top)
  for (std::size_t i = 0; i < n; ++i) top = std::max(top, std::abs(values[i]));
  return top;
}

}  // namespace

void report_solids(const SolidWorks& work, StepInfo& info) {
  for (std::size_t l = 0; l < work.size(); ++l) {
    info.max_speed_solid = std::max(info.max_speed_solid, work[l].max_speed);
    info.min_det_f = l == 0 ? work[l].min_det_f : std::min(info.min_det_f, work[l].min_det_f);
    info.max_det_f = l == 0 ? work[l].max_det_f : std::max(info.max_det_f, work[l].max_det_f);
    info.degenerate_cells += work[l].degenerate + work[l].rejected;
  }
}

double largest_component(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity) {
  const std::size_t plane = g.node_stride(2);
  return parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t k) {
    Real top = 0;
    for (const auto& c : velocity.c)
      top = std::max(top, largest(plane, c.data() + static_cast<std::size_t>(k) * plane));
    return static_cast<double>(top);
  });
}

}  // namespace efsi::sim
