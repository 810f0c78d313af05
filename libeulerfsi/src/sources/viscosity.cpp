#include "sources/viscosity.hpp"

#include "frame/grid_loops.hpp"

namespace efsi::sim {

using grid::Grid;

void diffuse_velocity(const StepContext& step, const Matter& matter, NodeVelocity& velocity,
                      fluid::ViscousWorkspace& work) {
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  const Grid& g = matter.common.grid;
  const double eighth = g.h * g.h * g.h / 8.0;
  work.mass.resize(g.node_count());
  step.parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const double volume = static_cast<double>(matter.specific_volume[n]);  // 0: given
        work.mass[n] = static_cast<Real>(volume > 0.0 ? eighth * adjacent_cells(g, i, j, k) / volume : 0.0);
      }
  });
  // Where solids share a node the field holds the film between them.
  for (const system::SlipNode& n : velocity.slip.nodes())
    if (n.shared() && work.mass[n.node] > 0) work.mass[n.node] = n.fluid_mass;
  const linalg::SolveStats stats = fluid::diffuse(step.parallel, g, matter.fixed, matter.owned,
                                                  step.scene.params.fluid.viscosity, step.dt, velocity.field, work);
  step.info.unconverged += !stats.converged;
  timer.visited(g.node_count(), static_cast<std::uint64_t>(stats.iterations + 1) * 12 * sizeof(Real));
}

}  // namespace efsi::sim
