#include "sim/step.hpp"

#include <algorithm>

#include "contact/fold_contact.hpp"
#include "contact/given_rows.hpp"
#include "contact/pair_friction.hpp"
#include "contact/particle_contact.hpp"
#include "contact/solid_contact.hpp"
#include "contact/wall_contact.hpp"
#include "contact/wall_friction.hpp"
#include "fluid/advect.hpp"
#include "frame/slab_state.hpp"
#include "given/prescribed.hpp"
#include "nodes/masses.hpp"
#include "nodes/node_velocity.hpp"
#include "record/contact_record.hpp"
#include "record/energy_ledger.hpp"
#include "record/side_record.hpp"
#include "record/step_record.hpp"
#include "sim/step_loss.hpp"
#include "sim/time_step.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_force.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/map/displacement.hpp"
#include "solid/particles/particles.hpp"
#include "solve/bulk.hpp"
#include "solve/pressure.hpp"
#include "solve/velocity_solve.hpp"
#include "solve/viscosity.hpp"
#include "sources/apply_forces.hpp"
#include "sources/external_forces.hpp"
#include "sources/jets.hpp"
#include "transport/carry_surface.hpp"
#include "transport/fluid_transport.hpp"
#include "transport/left_box.hpp"
#include "transport/momentum_balance.hpp"
#include "transport/repair_maps.hpp"
#include "transport/wall_frames.hpp"

namespace efsi::sim {
namespace {

// The forces of the scene.
void apply_scene_forces(const StepContext& step, const Matter& matter, SolidWorks& solids, SolidStates& states,
                        grid::VectorField& fluid_velocity, EnergyLedger& ledger) {
  if (step.scene.forces.empty()) return;
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  timer.visited(apply_forces(step, matter.common.grid, solids, states, fluid_velocity), 6 * sizeof(Real));
  ledger.book_forces(matter, fluid_velocity);
}

// Viscosity of the fluid, where it has any.
void diffuse(const StepContext& step, const Matter& matter, NodeVelocity& before, VelocityEquation& elasticity,
             NodeVelocity& velocity, fluid::ViscousWorkspace& viscous, EnergyLedger& ledger) {
  if (!step.scene.params.fluid.is_viscous()) return;
  diffuse_velocity(step, matter, before, elasticity, velocity, viscous);
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

// Which cells of solid l carry stiffness and which touch a collider, for the next step's choice.
void remember_elements(const StepContext& step, std::size_t l, const VelocityEquation& elasticity,
                       const solid::SolidWork& work, solid::SolidState& state) {
  const double cells = work.max_speed * step.dt / step.scene.grid.h;
  solid::remember_elements(work, has_element_hysteresis(is_on_wall(elasticity.walls, l), cells), state);
  for (const RowPlace& place : elasticity.contacts.places)
    if (place.room > 0.0 && (place.solids[0] == l || place.solids[1] == l))
      solid::remember_room(place.cell, place.room, state);
}

// Lines 12 to 16: the solids' velocities, on their grids or on particles, which repel each other.
void take_velocities(const StepContext& step, std::uint64_t steps, const grid::Grid& common, NodeVelocity& velocity,
                     SolidStates& states, SolidWorks& solids, std::vector<solid::Particles>& particles,
                     EnergyLedger& ledger) {
  const bool uses_particles = step.scene.params.numerics.uses_particles();
  if (uses_particles) particles.resize(solids.size());
  for (std::size_t l = 0; l < solids.size(); ++l) {
    ScopedTimer timer(step.profile, Stage::kSolidAdvection);
    const system::SolidView view(step.parallel, velocity.slip, l, velocity.field);
    const bool remembers = step.scene.params.numerics.damping_by_pace && !is_collider(step.scene.pins, l);
    solid::take_velocity(step.parallel, common, remembers ? step.dt : 0.0, velocity.field, states[l],  // Alg. 1 line 13
                         solids[l]);
    if (!uses_particles) continue;
    if (is_collider(step.scene.pins, l)) {  // its velocity is given everywhere
      std::fill(solids[l].layer.begin(), solids[l].layer.end(), std::uint8_t{0});
      continue;
    }
    solid::extend(step.parallel, step.scene.solids[l], states[l], solids[l]);
    ledger.leave(l);
    solid::seed_particles(step.parallel, step.scene.solids[l], states[l], solids[l], steps * solids.size() + l,
                          particles[l]);
    timer.visited(particles[l].size(), sizeof(Vec3d) + sizeof(Vec3));
  }
  if (uses_particles) step.info.contacts = repel_particles(step, states, solids, particles);  // Alg. 1 line 14
}

// Lines 18 to 20 for solid l: map, velocity and surface move with it, and its band follows.
void transport_solid(const StepContext& step, std::size_t l, const solid::BodyStep& frame, const Matter& matter,
                     const VelocityEquation& elasticity, const PressureEquation& pressure, solid::SolidWork& work,
                     solid::SolidState& state, solid::AdvectWorkspace& packed, std::vector<solid::Particles>& particles,
                     EnergyLedger& ledger) {
  const int slab = grid::slab_axis(step.scene.grid, step.scene.params.walls);
  if (is_collider(step.scene.pins, l)) {
    ScopedTimer timer(step.profile, Stage::kSolidAdvection);
    ledger.leave(l);
    place_collider(step, l, state, work);
    if (slab >= 0) flatten(step.parallel, step.scene.solids[l], slab, state);
    return;
  }
  if (solid::has_left(state)) {
    continue_motion(step.dt, state);
    return;
  }
  {
    ScopedTimer timer(step.profile, Stage::kSolidAdvection);
    if (step.scene.params.numerics.uses_particles()) {
      solid::rasterize(step.parallel, step.dt, step.scene.solids[l], particles[l], state, work);  // Alg. 1 line 18
    } else {
      solid::extend(step.parallel, step.scene.solids[l], state, work);
      ledger.leave(l);
      carry_dilatation(step, l, matter, pressure, work, state);
    }
    const solid::AdvectionScheme scheme = step.scene.params.numerics.solid_advection;
    solid::advect(step.parallel, scheme, step.dt, frame, work, state, packed);  // Alg. 1 lines 19, 20
    timer.visited(work.layer.size(), 12 * sizeof(Real));
    prescribe_map(step, l, state);
  }
  carry_surface(step, l, frame, packed, work, state);
  ScopedTimer timer(step.profile, Stage::kSolidAdvection);
  prescribe_surface(step, l, state);
  if (slab >= 0) flatten(step.parallel, step.scene.solids[l], slab, state);
  remember_elements(step, l, elasticity, work, state);
  solid::follow_solid(step.scene.grid, step.scene.solids[l], state);
}

// After the transport: lines 3 and 7 of the next step, of the solids where they are now, and what gives back what the
// transport has not kept.
void settle(const StepContext& step, const std::vector<VolumeTarget>& targets, State& state, Workspace& work,
            EnergyLedger& ledger) {
  const Numerics& numerics = step.scene.params.numerics;
  SolidWorks& solids = work.solids;
  SolidStates& states = state.solids;
  fluid::FluidState& fluid = state.fluid;
  work.masses_ready = numerics.repair_map || numerics.conserve_momentum;
  if (work.masses_ready) {
    compute_masses(step, states, solids);
    settle_entering(step, states, solids);
    remove_departed(step, states, solids);
    restore_centers(step, work.momenta, states, solids);
    ledger.arrive();
  }
  inspect_maps(step.scene.solids, solids, step.info.repairs);
  step.info.transport =
      transport_errors(step.parallel, step.scene.solids, states, solids, targets, work.momenta.solids);
  if (numerics.repair_map) repair_maps(step, states, solids);
  if (step.info.repairs.repaired_cells > 0) ledger.book_solids(EnergyStage::kRepair);
  if (work.masses_ready) {
    combine_masses(step, states, solids, state.window, fluid.pressure, work.matter, work.velocity.slip);
    ledger.book_fluid(EnergyStage::kRemap, work.matter, fluid.velocity);
  }
  if (numerics.conserve_momentum) {
    restore_momenta(step, work.momenta, solids, work.matter, states, fluid.velocity);
    if (const int slab = grid::slab_axis(step.scene.grid, step.scene.params.walls); slab >= 0)
      for (std::size_t l = 0; l < states.size(); ++l) flatten(step.parallel, step.scene.solids[l], slab, states[l]);
    ledger.book_solids(EnergyStage::kMomentum);
    ledger.book_fluid(EnergyStage::kMomentum, work.matter, fluid.velocity);
  }
  ScopedTimer timer(step.profile, Stage::kSmoke);
  const auto& [common, walls] = work.matter.common;
  fluid::settle_smoke(step.parallel, common, walls, work.matter.cell_fraction, fluid, work.advect);
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
void finish(const StepContext& step, const Matter& matter, const SolidWorks& solids, State& state) {
  {
    ScopedTimer timer(step.profile, Stage::kContact);
    record_sides(step.scene, state.solids, step.info.contacts);
  }
  step.info.time = state.time += step.dt;
  step.info.steps = 1;
  ++state.steps;
  for (std::size_t l = 0; l < solids.size(); ++l) state.solids[l].speed = solids[l].max_speed;
  report_solids(solids, step.info);
  if (!step.scene.params.fluid.present) return;
  const double fastest = largest_component(step.parallel, step.scene.grid, state.fluid.velocity);
  const bool films = step.scene.params.numerics.fluid_slips && !matter.mass.empty();  // which limit no step
  step.info.max_speed_fluid = fastest;
  state.fluid_speed =
      films ? largest_component(step.parallel, step.scene.grid, state.fluid.velocity, matter.fluid_mass, matter.mass)
            : fastest;
}

// Line 1, with what is given in the step: its motion limits the step, as folds and emitters do.
StepLimit choose_time_step(const Parallel& parallel, const Scene& scene, double remaining, State& state,
                           SolidWorks& solids) {
  begin_prescribed(parallel, scene, state.time, remaining, state.solids);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    if (!solid::has_left(state.solids[l])) find_near_folds(parallel, scene.solids[l], state.solids[l], solids[l]);
  const double fluid_speed = std::max(state.fluid_speed, fastest_jet(scene, state.time, remaining));
  return compute_time_step(parallel, scene, state.solids, fluid_speed, state.time, remaining,  // Alg. 1 line 1
                           solids);
}

// Lines 3 and 7, unless the last step has left them: masses, and which nodes are given.
void find_matter(const StepContext& step, State& state, Workspace& work) {
  if (!work.masses_ready) {
    compute_masses(step, state.solids, work.solids);  // Alg. 1 line 3
    remove_departed(step, state.solids, work.solids);
    combine_masses(step, state.solids, work.solids, state.window, state.fluid.pressure, work.matter,  // Alg. 1 line 7
                   work.velocity.slip);
  }
  work.elasticity.given = find_prescribed(step, state.solids, work.solids, work.matter, work.velocity.slip);
}

// Between lines 6 and 8: all forces but the solids' own, one velocity at the nodes, and what walls make of it.
void mix_velocities(const StepContext& step, State& state, Workspace& work, EnergyLedger& ledger) {
  grid::VectorField& fluid_velocity = state.fluid.velocity;
  NodeVelocity& velocity = work.velocity;
  VelocityEquation& elasticity = work.elasticity;
  if (step.scene.params.fluid.is_viscous())
    copy_velocities(step, state.solids, work.solids, work.matter, fluid_velocity, velocity.slip, work.before_forces);
  apply_scene_forces(step, work.matter, work.solids, state.solids, fluid_velocity, ledger);
  ledger.book_weight(weight_in_step(step.scene, step.dt, work.solids), fluid_velocity);
  combine_velocities(step, state.solids, work.solids, work.matter, fluid_velocity, velocity);
  ledger.book_nodes(EnergyStage::kMixing, velocity);
  add_external_forces(step, work.matter, state.fluid, velocity);
  ledger.book_nodes(EnergyStage::kExternal, velocity);
  prescribe_velocity(step, work.solids, work.matter, elasticity.given, velocity);
  meet_walls(step, state.solids, work.solids, work.matter, velocity, elasticity.walls);
  keep_prescribed(elasticity.given, elasticity.walls, velocity);
  ledger.book_nodes(EnergyStage::kWalls, velocity);
}

// Lines 8 to 11.
void solve(const StepContext& step, State& state, Workspace& work, EnergyLedger& ledger) {
  SolidStates& states = state.solids;
  fluid::FluidState& fluid = state.fluid;
  std::vector<Real>& last = fluid.pressure;  // line 11 puts that of the step in its place
  VelocityEquation& elasticity = work.elasticity;
  PressureEquation& pressure = work.pressure;
  NodeVelocity& velocity = work.velocity;
  assemble_velocity_system(step, states, work.solids, work.matter, velocity, elasticity);  // Alg. 1 line 8
  set_right_side(step, states, work.solids, work.matter.common.grid, velocity, elasticity);
  diffuse(step, work.matter, work.before_forces, elasticity, velocity, work.viscous, ledger);
  prepare_pressure(step, states, work.solids, work.matter, last, elasticity, velocity, pressure);
  ledger.book_nodes(EnergyStage::kPressure, velocity);
  solve_velocity(step, elasticity, velocity);  // Alg. 1 line 9
  ledger.book_nodes(EnergyStage::kVelocity, velocity);
  solve_pressure(step, states, work.solids, work.matter, fluid, elasticity, velocity, pressure);  // Alg. 1 line 10
  project_velocity(step, work.matter.common.grid, elasticity, pressure, velocity, last);          // Alg. 1 line 11
  ledger.book_nodes(EnergyStage::kPressure, velocity);
  ledger.book_source(last, pressure.source);
}

// What contact and given motion have done: for the next step, and what is reported of it; momenta of the solids, and
// what friction has too much of them or lacks.
void remember_contact(const StepContext& step, SolidStates& states, Workspace& work) {
  VelocityEquation& elasticity = work.elasticity;
  reset_above_walls(work.matter.mass, work.velocity, elasticity.walls);
  remember_rows(step.dt, elasticity.walls, states);
  remember_contacts(step.dt, elasticity.contacts, states);
  step.info.pins = sum_reactions(step, work.matter.common.grid, elasticity.given);
  const std::vector<Vec3d> coupling = coupling_impulses(elasticity, work.pressure);
  step.info.contacts = record_contacts(step.scene, states, elasticity.contacts, coupling);
  if (!step.scene.params.numerics.conserve_momentum) return;
  TransportMomenta& momenta = work.momenta;
  measure_momenta(step, states, work.solids, work.matter, work.velocity, momenta);
  momenta.friction =
      missing_friction(step.scene, elasticity.walls, work.velocity, work.matter.common.grid, momenta.solids);
  limit_pair_friction(step, states, elasticity.holds, elasticity.contacts, coupling, momenta.solids, momenta.friction);
}

// Lines 12 to 22.
void transport(const StepContext& step, State& state, Workspace& work, EnergyLedger& ledger) {
  const Holds& holds = work.elasticity.holds;
  NodeVelocity& velocity = work.velocity;
  const grid::Grid& common = work.matter.common.grid;
  std::vector<solid::BodyStep> frames = transport_frames(holds, work.momenta.first, work.momenta.solids, step.dt);
  if (step.scene.params.numerics.solid_advection != solid::AdvectionScheme::kPaper)
    strain_wall_frames(step, holds, work.elasticity.walls, state.solids, work.solids, work.momenta.solids, common,
                       velocity, frames);
  ledger.meet(velocity, frames);
  find_centers(step, holds, frames, state.solids, work.momenta);
  take_velocities(step, state.steps, common, velocity, state.solids, work.solids, work.particles, ledger);
  measure_straining(step, state.solids, work.solids);
  work.pressure.system.exchange_scratch(work.solid_advect.storage());
  for (std::size_t l = 0; l < state.solids.size(); ++l)
    transport_solid(step, l, frames[l], work.matter, work.elasticity, work.pressure, work.solids[l], state.solids[l],
                    work.solid_advect, work.particles, ledger);
  work.pressure.system.exchange_scratch(work.solid_advect.storage());
  still_fluid(work.elasticity.walls, velocity.field);
  advect_fluid(step, state.solids, velocity.field, velocity.slip, work.pressure,  // Alg. 1 line 22
               work.matter, state.fluid, work.advect);
  if (const int slab = grid::slab_axis(step.scene.grid, step.scene.params.walls);
      slab >= 0 && step.scene.params.fluid.present)
    flatten(step.parallel, common, slab, state.fluid.velocity);
  ledger.book_fluid(state.fluid.velocity);
  ledger.book_inflow(work.pressure.jets, velocity.field);
}

}  // namespace

StepInfo step(const Parallel& parallel, const Scene& scene, double remaining, double shrink, State& state,
              Workspace& work, Profile& profile) {
  StepInfo info;
  StepLimit limit = choose_time_step(parallel, scene, remaining, state, work.solids);
  const double planned_dt = limit.dt;
  if (shrink < 1.0) limit.lower(shrink * remaining, StepRule::kRepeated);
  info.dt = limit.dt;
  info.limit_rule = limit.rule, info.limiting_solid = limit.solid, info.limiting_other = limit.other;
  const StepContext step{parallel, scene, state.time, info.dt, planned_dt, profile, info};

  find_matter(step, state, work);
  EnergyLedger ledger(step, state.solids, work.solids, work.matter, state.fluid.velocity);
  if (scene.params.numerics.conserve_momentum) measure_first_momenta(step, state.solids, work.solids, work.momenta);
  compute_materials(step, work.solids, state.solids, ledger);
  mix_velocities(step, state, work, ledger);
  solve(step, state, work, ledger);
  remember_contact(step, state.solids, work);
  const std::vector<VolumeTarget> targets = volume_targets(scene.solids, state.solids, work.solids);
  transport(step, state, work, ledger);
  settle(step, targets, state, work, ledger);
  finish(step, work.matter, work.solids, state);
  close_ledger(step, state, work, ledger);
  return info;
}

}  // namespace efsi::sim
