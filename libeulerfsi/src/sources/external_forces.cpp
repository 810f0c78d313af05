#include "sources/external_forces.hpp"

#include "fluid/forces.hpp"

namespace efsi::sim {

using grid::Grid;

void add_external_forces(const StepContext& step, const Matter& matter, fluid::FluidState& fluid,
                         NodeVelocity& velocity) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  const Grid& g = matter.common.grid;
  ScopedTimer timer(profile, Stage::kFluidForces);
  const Real fluid_volume = static_cast<Real>(1.0 / scene.params.fluid.density);
  if (scene.params.fluid.present)
    fluid::apply_emitters(g, scene.emitters, time, dt, matter.cell_fraction, matter.specific_volume, fluid_volume,
                          fluid, &velocity.field);
  const std::uint64_t visited = fluid::add_body_forces(parallel, g, scene.params.fluid, fluid, scene.params.gravity, dt,
                                                       matter.specific_volume, velocity.field);
  timer.visited(visited, 4 * sizeof(Real));
}

}  // namespace efsi::sim
