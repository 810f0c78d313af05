#include "transport/fluid_transport.hpp"

#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "solve/carried_pressure.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// What flows in through an open face comes from fluid at rest: a jet that took its own speed from beyond the face would
// feed itself.
void still_inflow(const Parallel& parallel, const Grid& g, const grid::Walls& walls, grid::VectorField& velocity) {
  if (!walls.any_open()) return;
  for_face_nodes(parallel, g, [&](std::size_t n, int i, int j, int k) {
    const int index[3] = {i, j, k};
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<std::size_t>(a);
      const Real v = velocity.c[axis][n];
      const bool enters_low = index[a] == 0 && walls.lower(a) == grid::Wall::kOpen && v > 0;
      const bool enters_high = index[a] == g.cells[axis] && walls.upper(a) == grid::Wall::kOpen && v < 0;
      if (enters_low || enters_high) velocity.set(n, Vec3::Zero());
    }
  });
}

}  // namespace

void advect_fluid(const StepContext& step, const SolidStates& states, grid::VectorField& flow,
                  const system::SlipNodes& slip, PressureEquation& pressure, Matter& matter, fluid::FluidState& fluid,
                  fluid::AdvectWorkspace& work) {
  if (!step.scene.params.fluid.present) return;
  const bool corrected = step.scene.params.numerics.corrected_fluid_advection;
  const Real fluid_volume = static_cast<Real>(1.0 / step.scene.params.fluid.density);
  const Grid& g = matter.common.grid;
  const bool carries = step.scene.params.numerics.carries_pressure;
  system::PressureSystem& scratch = pressure.system;
  still_inflow(step.parallel, step.scene.grid, step.scene.params.walls, flow);
  scratch.exchange_scratch(work.storage());
  {
    ScopedTimer timer(step.profile, Stage::kSmoke);
    const std::uint64_t tiles = fluid::advect_smoke(step.parallel, g, corrected, step.dt, flow, matter.cell_fraction,
                                                    fluid, work, pressure.jets);
    timer.visited(512 * tiles, 6 * sizeof(Real));
  }
  if (carries) {
    ScopedTimer timer(step.profile, Stage::kFluidAdvection);
    work.exchange_carried();
    for (std::size_t a = 0; a < 3; ++a) linalg::copy(step.parallel, work.carried.c[a], flow.c[a]);
    // Solids push the fluid by impulses of one step. What the last pressure did not have by size is not carried.
    const double last = states.empty() ? 0.0 : spread_of(step.parallel, g, pressure.q);
    take_carried_pressure(step.parallel, matter.common, states, fluid.pressure, pressure.q);
    const double now = states.empty() ? 0.0 : spread_of(step.parallel, g, pressure.q);
    fluid.carried_time = now > last ? step.dt * (last / now) : step.dt;
    linalg::scale(step.parallel, pressure.q, -fluid.carried_time);
    pressure.system.project(step.parallel, pressure.q, work.carried);
    work.first.c[0].swap(pressure.q);  // no more needed
  }
  for (const system::SlipNode& n : slip.nodes())  // fluid like any other: corrected
    matter.specific_volume[n.node] = fluid_volume;
  {
    ScopedTimer timer(step.profile, Stage::kFluidAdvection);
    const std::uint64_t tiles =
        fluid::advect_velocity(step.parallel, g, corrected, step.dt, flow, carries ? work.carried : flow,
                               matter.specific_volume, fluid_volume, fluid, work);
    timer.visited(512 * tiles, 12 * sizeof(Real));
    grid::fill_copies(g, fluid.velocity);  // which rounding has led to other places
  }
  if (carries) {  // all arrays back
    work.first.c[0].swap(pressure.q);
    work.exchange_carried();
  }
  scratch.exchange_scratch(work.storage());
}

}  // namespace efsi::sim
