#include "sim/step.hpp"

#include "fluid/advect.hpp"
#include "fluid/forces.hpp"
#include "sim/coupling.hpp"
#include "sim/pressure.hpp"
#include "sim/time_step.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/material_force.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {

StepInfo step(const Parallel& parallel, const Scene& scene, double remaining, double shrink, State& state,
              Workspace& work, Profile& profile) {
  const Params& params = scene.params;
  const Numerics& numerics = params.numerics;
  const grid::Grid &box = scene.grid, &common = work.common.grid;
  const std::size_t solids = scene.solids.size();
  StepInfo info;

  // Alg. 1 line 1
  double dt = compute_time_step(parallel, scene, state, remaining);
  if (shrink < 1.0) dt = std::min(dt, shrink * remaining);
  info.dt = dt;

  if (!work.masses_ready) compute_masses(parallel, scene, state, work, profile);  // Alg. 1 lines 3, 7
  if (numerics.conserve_momentum) measure_first_momenta(parallel, state, work);
  for (std::size_t l = 0; l < solids; ++l) {  // lines 2-6
    ScopedTimer timer(profile, Stage::kComputeG);
    solid::compute_material(parallel, scene.solids[l], state.solids[l], numerics.points_per_element,  // Alg. 1 line 4
                            work.solids[l]);
    timer.visited(work.solids[l].element_cell.size(), sizeof(solid::ElementPoint));
  }
  {
    ScopedTimer timer(profile, Stage::kFluidForces);
    combine_velocities(parallel, scene, dt, state, work);
    add_external_forces(parallel, scene, dt, state, work, timer);
  }
  assemble_velocity_system(parallel, scene, dt, state, work, profile);  // Alg. 1 line 8
  prepare_pressure(parallel, scene, dt, state, work, profile);
  solve_velocity(parallel, scene, work, profile, info);               // Alg. 1 line 9
  solve_pressure(parallel, scene, dt, state, work, profile, info);    // Alg. 1 line 10
  project_velocity(parallel, scene, dt, state, work, profile, info);  // Alg. 1 line 11

  if (numerics.conserve_momentum) measure_momentum(parallel, scene, state, work);

  work.pressure_system.exchange_scratch(work.solid_advect.storage());
  for (std::size_t l = 0; l < solids; ++l) {  // lines 12-21
    {
      ScopedTimer timer(profile, Stage::kSolidAdvection);
      const system::SolidView view(parallel, work.slip, work.velocity);
      solid::update_velocity(parallel, common, work.velocity, state.solids[l], work.solids[l]);  // Alg. 1 lines 13, 18
      timer.visited(work.solids[l].layer.size(), 12 * sizeof(Real));
    }
    const solid::RigidStep frame = transport_frame(scene, work, l, dt);
    {
      ScopedTimer timer(profile, Stage::kSolidAdvection);
      solid::advect(parallel, numerics.solid_advection, dt, frame,  // Alg. 1 lines 19, 20
                    work.solids[l], state.solids[l], work.solid_advect);
    }
    {
      ScopedTimer timer(profile, Stage::kSurface);
      solid::predict_surface(parallel, dt, frame, work.solid_advect, state.solids[l]);
      solid::correct_surface(parallel, scene.solids[l], work.solids[l].max_stretch, state.solids[l]);
      solid::measure_leak(scene.solids[l], work.solids[l], state.solids[l]);
      state.solids[l].whole = solid::is_whole(box, params.walls, state.solids[l]);
      timer.visited(state.solids[l].surface.size(), sizeof(Vec3d));
    }
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    remember_elements(scene, work, l, dt, state);
    solid::follow_solid(box, scene.solids[l], state.solids[l]);
  }
  work.pressure_system.exchange_scratch(work.solid_advect.storage());
  advect_fluid(parallel, scene, dt, state, work, profile);  // Alg. 1 line 22
  work.masses_ready = false;
  if (numerics.repair_map || numerics.conserve_momentum) compute_masses(parallel, scene, state, work, profile);
  if (numerics.repair_map) repair_maps(parallel, scene, state, work, profile, info);
  if (numerics.conserve_momentum) restore_momentum(parallel, scene, state, work, profile);
  {
    ScopedTimer timer(profile, Stage::kSmoke);
    fluid::settle_smoke(parallel, common, work.common.walls, work.cell_fraction, state.fluid, work.advect);
  }

  state.time += dt;
  ++state.steps;
  measure(parallel, scene, state, work, info);
  return info;
}

}  // namespace efsi::sim
