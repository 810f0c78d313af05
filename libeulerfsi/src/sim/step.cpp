#include "sim/step.hpp"

#include "fluid/advect.hpp"
#include "fluid/forces.hpp"
#include "sim/coupling.hpp"
#include "sim/energy_ledger.hpp"
#include "sim/pressure.hpp"
#include "sim/time_step.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/material_force.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {
namespace {

EnergyLedger make_ledger(const Parallel& parallel, const Scene& scene, const State& state, const Workspace& work) {
  const Params& params = scene.params;
  return {parallel,
          params.energy_ledger,
          {scene.solids, state.solids, work.solids, params.numerics.points_per_element},
          {params.fluid.present, params.fluid.density, params.gravity}};
}

// The columns of the step. Where nothing needed the masses of the new state yet they are computed here; in a scene
// without fluid only the solids', since the common grid moves with the state of the next step.
const EnergyRecord& close_ledger(const Parallel& parallel, const Scene& scene, State& state, Workspace& work,
                                 Profile& profile, EnergyLedger& ledger) {
  if (work.masses_ready) return ledger.record();
  if (scene.params.fluid.present)
    compute_masses(parallel, scene, state, work, profile);
  else
    compute_solid_masses(parallel, scene, state, work, profile);
  ledger.arrive(work.mass, state.fluid.velocity);
  return ledger.record();
}

std::vector<solid::RigidStep> transport_frames(const Scene& scene, const Workspace& work, double dt) {
  std::vector<solid::RigidStep> frames;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) frames.push_back(transport_frame(scene, work, l, dt));
  return frames;
}

// Line 7 after the masses, and the right-hand side's forces.
void apply_forces(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                  Profile& profile, EnergyLedger& ledger) {
  ledger.open(work.common.grid, work.mass, state.fluid.velocity);
  ScopedTimer timer(profile, Stage::kFluidForces);
  const Weight weight = weight_in_step(scene, dt, work);
  ledger.weigh(state.fluid.velocity, weight.fluid, weight.solids);
  combine_velocities(parallel, scene, weight, state, work);
  ledger.book_nodes(EnergyStage::kMixing, work.slip, work.velocity);
  add_external_forces(parallel, scene, dt, state, work, timer);
  ledger.book_nodes(EnergyStage::kOutside, work.slip, work.velocity);
  impose_walls(parallel, work);
  ledger.book_nodes(EnergyStage::kWalls, work.slip, work.velocity);
}

// What production does after line 22 with the solids, and what the step reports of it.
void repair_and_restore(const Parallel& parallel, const Scene& scene, const std::vector<VolumeTarget>& targets,
                        State& state, Workspace& work, Profile& profile, EnergyLedger& ledger, StepInfo& info) {
  const Numerics& numerics = scene.params.numerics;
  ledger.book_fluid(state.fluid.velocity);
  work.masses_ready = false;
  if (numerics.repair_map || numerics.conserve_momentum) {
    compute_masses(parallel, scene, state, work, profile);
    ledger.arrive(work.mass, state.fluid.velocity);
  }
  inspect_before(scene.solids, work.solids, info.repairs);
  for (std::size_t l = 0; numerics.conserve_momentum && l < scene.solids.size(); ++l)
    info.transport.push_back(transport_change(parallel, scene.solids[l], state.solids[l], work.solids[l], targets[l],
                                              work.solid_momenta[l]));
  if (numerics.repair_map) info.repairs.put_back = repair_maps(parallel, scene, state, work, profile);
  if (info.repairs.put_back > 0) {
    info.degenerate_cells += info.repairs.put_back;
    inspect_after(scene.solids, work.solids, info.repairs);
    ledger.book_state(EnergyStage::kRepair, work.mass, state.fluid.velocity, true);
  }
  if (!numerics.conserve_momentum) return;
  restore_momentum(parallel, scene, state, work, profile);
  ledger.book_state(EnergyStage::kMomentum, work.mass, state.fluid.velocity, false);
}

}  // namespace

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

  EnergyLedger ledger = make_ledger(parallel, scene, state, work);

  if (!work.masses_ready) compute_masses(parallel, scene, state, work, profile);  // Alg. 1 lines 3, 7
  if (numerics.conserve_momentum) measure_first_momenta(parallel, state, work);
  for (std::size_t l = 0; l < solids; ++l) {  // lines 2-6
    ScopedTimer timer(profile, Stage::kComputeG);
    solid::compute_material(parallel, scene.solids[l], state.solids[l], numerics.points_per_element,  // Alg. 1 line 4
                            work.solids[l]);
    timer.visited(work.solids[l].element_cell.size(), sizeof(solid::ElementPoint));
  }
  apply_forces(parallel, scene, dt, state, work, profile, ledger);
  assemble_velocity_system(parallel, scene, dt, state, work, profile);  // Alg. 1 line 8
  prepare_pressure(parallel, scene, dt, state, work, profile);
  ledger.book_nodes(EnergyStage::kPressure, work.slip, work.velocity);
  solve_velocity(parallel, scene, work, profile, info);  // Alg. 1 line 9
  ledger.book_nodes(EnergyStage::kVelocity, work.slip, work.velocity);
  solve_pressure(parallel, scene, dt, state, work, profile, info);    // Alg. 1 line 10
  project_velocity(parallel, scene, dt, state, work, profile, info);  // Alg. 1 line 11
  ledger.book_nodes(EnergyStage::kPressure, work.slip, work.velocity);
  ledger.book_source(state.fluid.pressure, work.source, dt);

  if (numerics.conserve_momentum) measure_momentum(parallel, scene, state, work);
  const std::vector<solid::RigidStep> frames = transport_frames(scene, work, dt);
  ledger.meet(work.slip, work.velocity, frames, dt);
  std::vector<VolumeTarget> targets;

  work.pressure_system.exchange_scratch(work.solid_advect.storage());
  for (std::size_t l = 0; l < solids; ++l) {  // lines 12-21
    {
      ScopedTimer timer(profile, Stage::kSolidAdvection);
      const system::SolidView view(parallel, work.slip, work.velocity);
      solid::update_velocity(parallel, common, work.velocity, state.solids[l], work.solids[l]);  // Alg. 1 lines 13, 18
      timer.visited(work.solids[l].layer.size(), 12 * sizeof(Real));
    }
    ledger.leave(l);
    targets.push_back(volume_target(scene.solids[l], state.solids[l], work.solids[l]));
    {
      ScopedTimer timer(profile, Stage::kSolidAdvection);
      solid::advect(parallel, numerics.solid_advection, dt, frames[l],  // Alg. 1 lines 19, 20
                    work.solids[l], state.solids[l], work.solid_advect);
    }
    {
      ScopedTimer timer(profile, Stage::kSurface);
      solid::predict_surface(parallel, dt, frames[l], work.solid_advect, state.solids[l]);
      solid::correct_surface(parallel, scene.solids[l], state.solids[l]);
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
  repair_and_restore(parallel, scene, targets, state, work, profile, ledger, info);
  {
    ScopedTimer timer(profile, Stage::kSmoke);
    fluid::settle_smoke(parallel, common, work.common.walls, work.cell_fraction, state.fluid, work.advect);
  }

  state.time += dt;
  ++state.steps;
  measure(parallel, scene, state, work, info);
  if (ledger.on()) info.energy = close_ledger(parallel, scene, state, work, profile, ledger);
  return info;
}

}  // namespace efsi::sim
