#include "sources/wall_inflow.hpp"

#include "frame/grid_loops.hpp"
#include "sources/volume_source.hpp"

namespace efsi::sim {

using grid::Grid;

void balance_inflow(const StepContext& step, const SolidWorks& solids, const Matter& matter,
                    const NodeVelocity& velocity, const std::vector<WallRow>& rows, double& balanced,
                    std::vector<Real>& source) {
  const Grid& g = matter.common.grid;
  if (source.empty() || !step.scene.params.fluid.present || step.scene.params.walls.any_open()) return;
  double inflow = -velocity.slip.opening(velocity.field);  // [m^3/s]
  for (const WallRow& row : rows) {
    if (!row.on_wall || velocity.slip.find(row.solid, row.node) != system::SlipNodes::kNone) continue;
    const auto [i, j, k] = g.node_place(row.node);
    inflow += g.h * g.h / 4.0 * adjacent_cells(g, i, j, k) *
              static_cast<double>(row.out * velocity.field.at(row.node)[row.axis]);
  }
  const double fluid_cells = count_fluid_cells(g, solids);
  if (inflow == balanced || fluid_cells < 1.0) return;
  const double share = (inflow - balanced) / (g.h * g.h * g.h * fluid_cells);
  take_from_fluid(step.parallel, matter, static_cast<Real>(share), source);
  balanced = inflow;
}

}  // namespace efsi::sim
