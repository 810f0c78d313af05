#include "sources/external_forces.hpp"

#include "fluid/forces.hpp"

namespace efsi::sim {

using grid::Grid;

void add_external_forces(const StepContext& step, const Matter& matter, fluid::FluidState& fluid,
                         NodeVelocity& velocity) {
  const Grid& g = matter.common.grid;
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  const Real fluid_volume = static_cast<Real>(1.0 / step.scene.params.fluid.density);
  if (step.scene.params.fluid.present)
    fluid::apply_emitters(g, step.scene.emitters, step.time, step.dt, matter.cell_fraction, matter.specific_volume,
                          fluid_volume, fluid, &velocity.field);
  const std::uint64_t visited =
      fluid::add_body_forces(step.parallel, g, step.scene.params.fluid, fluid, step.scene.params.gravity, step.dt,
                             matter.specific_volume, velocity.field);
  timer.visited(visited, 4 * sizeof(Real));
}

}  // namespace efsi::sim
