#include "sim/step.hpp"

#include <algorithm>

#include "fluid/advect.hpp"
#include "sim/carry_surface.hpp"
#include "sim/fluid_transport.hpp"
#include "sim/masses.hpp"
#include "sim/momentum_balance.hpp"
#include "sim/node_velocity.hpp"
#include "sim/pressure.hpp"
#include "sim/repair_maps.hpp"
#include "sim/time_step.hpp"
#include "sim/velocity_solve.hpp"
#include "sim/wall_contact.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/material_force.hpp"

namespace efsi::sim {
namespace {

// Which cells carry stiffness, for the next step's choice.
void remember_elements(const StepContext& step, const Hold& hold, const solid::SolidWork& work,
                       solid::SolidState& state) {
  if (choice_lags(hold, work.max_speed * step.dt / step.scene.grid.h))
    solid::remember_elements(work, state);
  else
    state.stiff.clear();
}

// The state after a step of dt, and what the step reports.
void finish(const StepContext& step, const SolidWorks& solids, State& state) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  info.time = state.time += dt;
  info.steps = 1;
  ++state.steps;
  for (std::size_t l = 0; l < solids.size(); ++l) state.solids[l].speed = solids[l].max_speed;
  report_solids(solids, info);
  if (!scene.params.fluid.present) return;
  info.max_speed_fluid = state.fluid_speed = largest_component(parallel, scene.grid, state.fluid.velocity);
}

}  // namespace

StepInfo step(const Parallel& parallel, const Scene& scene, double remaining, double shrink, State& state,
              Workspace& work, Profile& profile) {
  const Numerics& numerics = scene.params.numerics;
  auto& [solids, matter, velocity, elasticity, pressure, momenta, advect, solid_advect, backup, ready] = work;
  const grid::Grid& common = matter.common.grid;
  SolidStates& states = state.solids;
  fluid::FluidState& fluid = state.fluid;
  StepInfo info;
  double dt = compute_time_step(parallel, scene, states, state.fluid_speed, remaining);  // Alg. 1 line 1
  if (shrink < 1.0) dt = std::min(dt, shrink * remaining);
  info.dt = dt;
  const StepContext step{parallel, scene, state.time, dt, profile, info};

  if (!ready) {                            // else the last step has left them
    compute_masses(step, states, solids);  // Alg. 1 line 3
    combine_masses(step, states, solids, state.window, fluid.pressure, matter, velocity.slip);  // Alg. 1 line 7
  }
  if (numerics.conserve_momentum) measure_first_momenta(step, states, solids, momenta);
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {  // lines 2-6
    ScopedTimer timer(profile, Stage::kComputeG);
    solid::compute_material(parallel, scene.solids[l], states[l], numerics.points_per_element,  // Alg. 1 line 4
                            solids[l]);
    timer.visited(solids[l].element_cell.size(), sizeof(solid::ElementPoint));
  }
  combine_velocities(step, states, solids, matter, fluid.velocity, velocity);
  add_external_forces(step, matter, fluid, velocity);
  meet_walls(step, states, solids, matter, velocity.field, elasticity.walls);
  assemble_velocity_system(step, states, solids, matter, velocity, elasticity);  // Alg. 1 line 8
  prepare_pressure(step, states, solids, matter, fluid.pressure, elasticity, velocity, pressure);
  solve_velocity(step, elasticity, velocity);                                                    // Alg. 1 line 9
  solve_pressure(step, states, solids, matter, fluid.pressure, elasticity, velocity, pressure);  // Alg. 1 line 10
  project_velocity(step, common, elasticity, pressure, velocity, fluid.pressure);                // Alg. 1 line 11
  remember_rows(dt, elasticity.walls, states);
  if (numerics.conserve_momentum) measure_momenta(step, states, solids, matter, velocity, momenta);

  for (std::size_t l = 0; l < scene.solids.size(); ++l) {  // lines 12-16
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    const system::SolidView view(parallel, velocity.slip, velocity.field);
    solid::take_velocity(parallel, common, velocity.field, states[l], solids[l]);  // Alg. 1 line 13
  }
  pressure.system.exchange_scratch(solid_advect.storage());
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {  // lines 17-21
    const Hold& hold = elasticity.holds.of(l);
    solid::RigidStep frame;  // at rest
    if (numerics.conserve_momentum) frame = transport_frame(hold, momenta.first[l], momenta.solids[l], dt);
    {
      ScopedTimer timer(profile, Stage::kSolidAdvection);
      solid::extend(parallel, states[l], solids[l]);                                      // Alg. 1 line 18
      solid::advect(parallel, numerics.solid_advection, dt, frame, solids[l], states[l],  // Alg. 1 lines 19, 20
                    solid_advect);
      timer.visited(solids[l].layer.size(), 12 * sizeof(Real));
    }
    carry_surface(step, l, frame, solid_advect, solids[l], states[l]);
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    remember_elements(step, hold, solids[l], states[l]);
    solid::follow_solid(scene.grid, scene.solids[l], states[l]);
  }
  pressure.system.exchange_scratch(solid_advect.storage());
  still_fluid(elasticity.walls, velocity.field);
  advect_fluid(step, velocity.field, velocity.slip, matter, fluid, advect, pressure.system);  // Alg. 1 line 22

  ready = numerics.repair_map || numerics.conserve_momentum;
  if (ready) {  // lines 3 and 7 of the next step, of the solids where they are now
    compute_masses(step, states, solids);
    if (numerics.repair_map) repair_maps(step, states, solids);
    combine_masses(step, states, solids, state.window, fluid.pressure, matter, velocity.slip);
  }
  if (numerics.conserve_momentum) restore_momenta(step, momenta, solids, matter, states, fluid.velocity);
  {
    ScopedTimer timer(profile, Stage::kSmoke);
    fluid::settle_smoke(parallel, common, matter.common.walls, matter.cell_fraction, fluid, advect);
  }
  finish(step, solids, state);
  return info;
}

}  // namespace efsi::sim
