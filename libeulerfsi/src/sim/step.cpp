#include "sim/step.hpp"

#include <algorithm>

#include "contact/fold_contact.hpp"
#include "contact/given_rows.hpp"
#include "contact/particle_contact.hpp"
#include "contact/solid_contact.hpp"
#include "contact/wall_contact.hpp"
#include "fluid/advect.hpp"
#include "frame/slab_state.hpp"
#include "given/prescribed.hpp"
#include "nodes/masses.hpp"
#include "nodes/node_velocity.hpp"
#include "record/contact_record.hpp"
#include "record/energy_ledger.hpp"
#include "sim/time_step.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_force.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/map/displacement.hpp"
#include "solid/particles/particles.hpp"
#include "solve/pressure.hpp"
#include "solve/velocity_solve.hpp"
#include "sources/apply_forces.hpp"
#include "sources/external_forces.hpp"
#include "sources/jets.hpp"
#include "sources/viscosity.hpp"
#include "transport/carry_surface.hpp"
#include "transport/fluid_transport.hpp"
#include "transport/left_box.hpp"
#include "transport/momentum_balance.hpp"
#include "transport/repair_maps.hpp"

namespace efsi::sim {
namespace {

// The forces of the scene.
void push(const StepContext& step, const Matter& matter, SolidWorks& solids, SolidStates& states,
          grid::VectorField& fluid_velocity, EnergyLedger& ledger) {
  if (step.scene.forces.empty()) return;
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  apply_forces(step, matter.common.grid, solids, states, fluid_velocity);
  ledger.book_forces(matter, fluid_velocity);
}

// Viscosity of the fluid, where it has any.
void diffuse(const StepContext& step, const Matter& matter, NodeVelocity& velocity, fluid::ViscousWorkspace& viscous,
             EnergyLedger& ledger) {
  if (!step.scene.params.fluid.is_viscous()) return;
  diffuse_velocity(step, matter, velocity, viscous);
  ledger.book_nodes(EnergyStage::kViscosity, velocity);
}

// Lines 2 to 6. What can yield flows around its forces: the displacement of one time stands for the half step before it
// and for that after it. At the start there is one before it too: the velocities are those of its beginning.
void compute_materials(const StepContext& step, SolidWorks& solids, SolidStates& states, EnergyLedger& ledger) {
  const int points = step.scene.params.numerics.points_per_element;
  bool any_yields = false;
  for (std::size_t l = 0; l < solids.size(); ++l) {
    ScopedTimer timer(step.profile, Stage::kComputeG);
    const solid::SolidRest& rest = step.scene.solids[l];
    const auto flow = [&](double time) { return solid::flow(step.parallel, rest, time, points, solids[l], states[l]); };
    const double half = 0.5 * step.dt, due = states[l].flow_due;
    const bool yields = rest.plastic.yields(), flows = yields && flow(due > 0.0 ? due : half);
    solid::compute_material(step.parallel, rest, states[l], points, solids[l]);  // Alg. 1 line 4
    timer.visited(solids[l].element_cell.size(), sizeof(solid::ElementPoint));
    if (flows) flow(half);
    if (yields) states[l].flow_due = half;
    any_yields = any_yields || yields;
  }
  if (any_yields) ledger.book_solids(EnergyStage::kPlasticFlow);
}

// Which cells carry stiffness, for the next step's choice.
void remember_elements(const StepContext& step, const Hold& hold, const solid::SolidWork& work,
                       solid::SolidState& state) {
  if (choice_lags(hold, work.max_speed * step.dt / step.scene.grid.h))
    solid::remember_elements(work, state);
  else
    state.stiff.clear();
}

// Lines 12 to 16: the solids' velocities, on their grids or on particles, which repel each other.
void take_velocities(const StepContext& step, std::uint64_t steps, const grid::Grid& common, NodeVelocity& velocity,
                     SolidStates& states, SolidWorks& solids, std::vector<solid::Particles>& particles,
                     EnergyLedger& ledger) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  const bool uses_particles = scene.params.numerics.uses_particles();
  if (uses_particles) particles.resize(solids.size());
  for (std::size_t l = 0; l < solids.size(); ++l) {
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    const system::SolidView view(parallel, velocity.slip, l, velocity.field);
    solid::take_velocity(parallel, common, velocity.field, states[l], solids[l]);  // Alg. 1 line 13
    if (!uses_particles) continue;
    if (is_collider(scene.pins, l)) {  // its velocity is given everywhere
      std::fill(solids[l].layer.begin(), solids[l].layer.end(), std::uint8_t{0});
      continue;
    }
    solid::extend(parallel, scene.solids[l], states[l], solids[l]);
    ledger.leave(l);
    solid::seed_particles(parallel, scene.solids[l], states[l], solids[l], steps * solids.size() + l, particles[l]);
    timer.visited(particles[l].size(), sizeof(Vec3d) + sizeof(Vec3));
  }
  if (uses_particles) info.contacts = repel_particles(step, states, solids, particles);  // Alg. 1 line 14
}

// Lines 18 to 20 for solid l: map, velocity and surface move with it, and its band follows.
void transport_solid(const StepContext& step, std::size_t l, const solid::RigidStep& frame, const Hold& hold,
                     solid::SolidWork& work, solid::SolidState& state, solid::AdvectWorkspace& packed,
                     std::vector<solid::Particles>& particles, EnergyLedger& ledger) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  const int slab = grid::slab_axis(scene.grid, scene.params.walls);
  if (is_collider(scene.pins, l)) {
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    ledger.leave(l);
    place_collider(step, l, state, work);
    if (slab >= 0) flatten(parallel, scene.solids[l], slab, state);
    return;
  }
  if (solid::has_left(state)) {
    fly_on(dt, state);
    return;
  }
  {
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    if (scene.params.numerics.uses_particles()) {
      solid::rasterize(parallel, dt, scene.solids[l], particles[l], state, work);  // Alg. 1 line 18
    } else {
      solid::extend(parallel, scene.solids[l], state, work);
      ledger.leave(l);
    }
    solid::advect(parallel, scene.params.numerics.solid_advection, dt, frame, work, state,  // Alg. 1 lines 19, 20
                  packed);
    timer.visited(work.layer.size(), 12 * sizeof(Real));
    give_map(step, l, state);
  }
  carry_surface(step, l, frame, packed, work, state);
  ScopedTimer timer(profile, Stage::kSolidAdvection);
  give_surface(step, l, state);
  if (slab >= 0) flatten(parallel, scene.solids[l], slab, state);
  remember_elements(step, hold, work, state);
  solid::follow_solid(scene.grid, scene.solids[l], state);
}

// After the transport: lines 3 and 7 of the next step, of the solids where they are now, and what gives back what the
// transport has not kept.
void settle(const StepContext& step, const std::vector<VolumeTarget>& targets, State& state, Workspace& work,
            EnergyLedger& ledger) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  const Numerics& numerics = scene.params.numerics;
  auto& [solids, matter, velocity, elasticity, pressure, momenta, advect, solid_advect, viscous, particles, backup,
         ready] = work;
  SolidStates& states = state.solids;
  fluid::FluidState& fluid = state.fluid;
  ready = numerics.repair_map || numerics.conserve_momentum;
  if (ready) {
    compute_masses(step, states, solids);
    let_leave(step, states, solids);
    ledger.arrive();
  }
  inspect_maps(scene.solids, solids, info.repairs);
  info.transport = transport_changes(parallel, scene.solids, states, solids, targets, momenta.solids);
  if (numerics.repair_map) repair_maps(step, states, solids);
  if (info.repairs.put_back > 0) ledger.book_solids(EnergyStage::kRepair);
  if (ready) {
    combine_masses(step, states, solids, state.window, fluid.pressure, matter, velocity.slip);
    ledger.book_fluid(EnergyStage::kRemap, matter, fluid.velocity);
  }
  if (numerics.conserve_momentum) {
    restore_momenta(step, momenta, solids, matter, states, fluid.velocity);
    if (const int slab = grid::slab_axis(scene.grid, scene.params.walls); slab >= 0)
      for (std::size_t l = 0; l < states.size(); ++l) flatten(parallel, scene.solids[l], slab, states[l]);
    ledger.book_solids(EnergyStage::kMomentum);
    ledger.book_fluid(EnergyStage::kMomentum, matter, fluid.velocity);
  }
  ScopedTimer timer(profile, Stage::kSmoke);
  fluid::settle_smoke(parallel, matter.common.grid, matter.common.walls, matter.cell_fraction, fluid, advect);
}

// The last columns of the ledger where nothing has needed the masses of the new state: these are computed here. Without
// fluid only the solids', since the common grid moves with the state of the next step.
void close_ledger(const StepContext& step, State& state, Workspace& work, EnergyLedger& ledger) {
  if (!ledger.on() || work.masses_ready) return;
  compute_masses(step, state.solids, work.solids);
  ledger.arrive();
  if (!step.scene.params.fluid.present) return;
  combine_masses(step, state.solids, work.solids, state.window, state.fluid.pressure, work.matter, work.velocity.slip);
  ledger.book_fluid(EnergyStage::kRemap, work.matter, state.fluid.velocity);
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
  auto& [solids, matter, velocity, elasticity, pressure, momenta, advect, solid_advect, viscous, particles, backup,
         ready] = work;
  const grid::Grid& common = matter.common.grid;
  SolidStates& states = state.solids;
  fluid::FluidState& fluid = state.fluid;
  StepInfo info;
  begin_given(parallel, scene, state.time, remaining, states);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    if (!solid::has_left(states[l])) find_near_folds(parallel, scene.solids[l], states[l], solids[l]);
  const double fluid_speed = std::max(state.fluid_speed, fastest_jet(scene, state.time, remaining));
  double dt = compute_time_step(parallel, scene, states, fluid_speed, state.steps, remaining, solids);  // Alg. 1 line 1
  if (shrink < 1.0) dt = std::min(dt, shrink * remaining);
  info.dt = dt;
  const StepContext step{parallel, scene, state.time, dt, profile, info};

  if (!ready) {                            // else the last step has left them
    compute_masses(step, states, solids);  // Alg. 1 line 3
    let_leave(step, states, solids);
    combine_masses(step, states, solids, state.window, fluid.pressure, matter, velocity.slip);  // Alg. 1 line 7
  }
  elasticity.given = find_given(step, states, solids, matter, velocity.slip);
  EnergyLedger ledger(step, states, solids, matter, fluid.velocity);
  if (numerics.conserve_momentum) measure_first_momenta(step, states, solids, momenta);
  compute_materials(step, solids, states, ledger);  // lines 2-6
  push(step, matter, solids, states, fluid.velocity, ledger);
  ledger.book_weight(weight_in_step(scene, dt, solids), fluid.velocity);
  combine_velocities(step, states, solids, matter, fluid.velocity, velocity);
  ledger.book_nodes(EnergyStage::kMixing, velocity);
  add_external_forces(step, matter, fluid, velocity);
  ledger.book_nodes(EnergyStage::kOutside, velocity);
  give_velocity(step, solids, matter, elasticity.given, velocity);
  meet_walls(step, states, solids, matter, velocity, elasticity.walls);
  keep_given(elasticity.given, elasticity.walls, velocity);
  ledger.book_nodes(EnergyStage::kWalls, velocity);
  diffuse(step, matter, velocity, viscous, ledger);
  assemble_velocity_system(step, states, solids, matter, velocity, elasticity);  // Alg. 1 line 8
  prepare_pressure(step, states, solids, matter, fluid.pressure, elasticity, velocity, pressure);
  ledger.book_nodes(EnergyStage::kPressure, velocity);
  solve_velocity(step, elasticity, velocity);  // Alg. 1 line 9
  ledger.book_nodes(EnergyStage::kVelocity, velocity);
  solve_pressure(step, states, solids, matter, fluid.pressure, elasticity, velocity, pressure);  // Alg. 1 line 10
  project_velocity(step, common, elasticity, pressure, velocity, fluid.pressure);                // Alg. 1 line 11
  ledger.book_nodes(EnergyStage::kPressure, velocity);
  ledger.book_source(fluid.pressure, pressure.source);
  keep_off(matter.mass, velocity, elasticity.walls);
  remember_rows(dt, elasticity.walls, states);
  remember_contacts(dt, elasticity.contacts, states);
  info.pins = sum_reactions(step, common, elasticity.given);
  info.jets = pressure.jets.flux;
  info.contacts = record_contacts(scene, states, elasticity, pressure);
  if (numerics.conserve_momentum) measure_momenta(step, states, solids, matter, velocity, momenta);
  const std::vector<solid::RigidStep> frames = transport_frames(elasticity.holds, momenta.first, momenta.solids, dt);
  const std::vector<VolumeTarget> targets = volume_targets(scene.solids, states, solids);
  ledger.meet(velocity, frames);

  take_velocities(step, state.steps, common, velocity, states, solids, particles, ledger);  // lines 12-16
  pressure.system.exchange_scratch(solid_advect.storage());
  for (std::size_t l = 0; l < scene.solids.size(); ++l)  // lines 17-21
    transport_solid(step, l, frames[l], elasticity.holds.of(l), solids[l], states[l], solid_advect, particles, ledger);
  pressure.system.exchange_scratch(solid_advect.storage());
  still_fluid(elasticity.walls, velocity.field);
  advect_fluid(step, velocity.field, velocity.slip, pressure.jets, matter, fluid, advect,  // Alg. 1 line 22
               pressure.system);
  if (const int slab = grid::slab_axis(scene.grid, scene.params.walls); slab >= 0 && scene.params.fluid.present)
    flatten(parallel, common, slab, fluid.velocity);
  ledger.book_fluid(fluid.velocity);
  ledger.book_inflow(pressure.jets, velocity.field);
  settle(step, targets, state, work, ledger);
  finish(step, solids, state);
  close_ledger(step, state, work, ledger);
  return info;
}

}  // namespace efsi::sim
