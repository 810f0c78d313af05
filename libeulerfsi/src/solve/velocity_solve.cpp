#include "solve/velocity_solve.hpp"

#include <algorithm>
#include <cmath>

#include "contact/given_rows.hpp"
#include "contact/solid_contact.hpp"
#include "contact/wall_contact.hpp"
#include "given/prescribed.hpp"
#include "linalg/reduce.hpp"
#include "solid/map/displacement.hpp"
#include "solve/reactions.hpp"
#include "system/contact_solve.hpp"

namespace efsi::sim {
namespace {

// Largest violation by a pair of surfaces, of their approach in the step; at least and at most, in cells: what rests
// may creep by the one, and the other is little of the overlap that is allowed.
constexpr double kNegligible = 0.015, kLeastNegligible = 1e-3, kMostNegligible = 2e-3;
constexpr int kMostPasses = 4;  // of the velocity solve, each with the rows that the last one has led into walls

// Calls body(3 unknown, node of the band) for the nodes that solid l carries.
template <class Body>
void for_unknowns(const SolidStates& states, const SolidWorks& solids, std::size_t l, const grid::Grid& common,
                  const system::VelocitySystem& system, const Body& body) {
  const grid::Grid& band = states[l].band.grid;
  const Vec3i lo = grid::offset(band, common);
  for (std::size_t n = 0; n < solids[l].carries.size(); ++n) {
    if (!solids[l].carries[n]) continue;
    const Vec3i at = band.node_place(n);
    body(3 * system.unknown_of(l, common.node(at[0] + lo[0], at[1] + lo[1], at[2] + lo[2])), n);
  }
}

// The velocities of the solids at the start of the step on the unknowns, as far as nothing is prescribed.
std::vector<Real> old_velocities(const SolidStates& states, const SolidWorks& solids, const grid::Grid& common,
                                 const VelocityEquation& elasticity) {
  std::vector<Real> old = elasticity.v_star;
  for (std::size_t l = 0; l < states.size(); ++l)
    for_unknowns(states, solids, l, common, elasticity.system, [&](std::size_t u, std::size_t n) {
      for (std::size_t a = 0; a < 3; ++a)
        if (elasticity.system.free()[u + a] > 0) old[u + a] = states[l].v.c[a][n];
    });
  return old;
}

// K (behind v_old - memory r D) to the right-hand side: v_old without the forces of the scene, which differ from place
// to place and would strain the solids; D what it changed by in the last step, which was 1 / r times as long.
void add_past_stiffness(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const grid::Grid& common, VelocityEquation& elasticity) {
  system::VelocitySystem& system = elasticity.system;
  std::vector<Real> old;
  for (std::size_t l = 0; l < states.size(); ++l) {
    const grid::VectorField& force_velocity = solids[l].force_velocity;
    const grid::VectorField& change = states[l].change;
    const system::StiffnessShares& shares = system.shares(l);
    const bool pushed = force_velocity.size() > 0, remembers = shares.memory > 0.0 && change.size() > 0;
    if (!pushed && !remembers) continue;
    const Real memory =
        remembers ? static_cast<Real>(shares.memory / shares.behind * step.dt / states[l].change_time) : Real(0);
    if (old.empty()) old = elasticity.v_star;
    for_unknowns(states, solids, l, common, system, [&](std::size_t u, std::size_t n) {
      for (std::size_t a = 0; a < 3; ++a) {
        if (!(system.free()[u + a] > 0)) continue;
        if (pushed) old[u + a] -= force_velocity.c[a][n];
        if (remembers) old[u + a] -= memory * change.c[a][n];
      }
    });
  }
  system.add_past_stiffness(step.parallel, old.empty() ? elasticity.v_star : old, elasticity.f_star);
}

// Starts the solve at the old velocity where that leaves less of f + B^T r, r the impulses of the last step: what
// presses on something, or is held by a pin, hardly moves faster for its weight. And the solve is as good as its start
// is: from a free fall all of the residual is where something holds the solid, and a part of it says nothing of the
// rest.
void choose_start(const Parallel& parallel, VelocityEquation& elasticity) {
  if (elasticity.v_old.empty()) return;
  std::vector<Real> loaded = elasticity.f_star;
  system::add_impulses(elasticity.contacts.rows, loaded);
  system::VelocitySystem& system = elasticity.system;
  if (system.residual(parallel, loaded, elasticity.v_old) < system.residual(parallel, loaded, elasticity.v_star))
    elasticity.v_star = elasticity.v_old;
}

// Velocity by which two surfaces may be led beyond what contact allows [m/s].
double negligible_velocity(const std::vector<system::ContactRow>& rows, const std::vector<Real>& v,
                           double cells_per_step) {
  double fastest = 0.0;
  for (const system::ContactRow& row : rows) fastest = std::max(fastest, system::row_velocity(row, v).norm());
  return std::clamp(kNegligible * fastest, kLeastNegligible * cells_per_step, kMostNegligible * cells_per_step);
}

}  // namespace

void assemble_velocity_system(const StepContext& step, SolidStates& states, SolidWorks& solids, const Matter& matter,
                              NodeVelocity& velocity, VelocityEquation& elasticity) {
  if (step.scene.solids.empty()) return;
  SolidContacts& contacts = elasticity.contacts;
  {
    ScopedTimer timer(step.profile, Stage::kContact);
    contacts = find_solid_contacts(step, states, solids, matter.common, velocity);
    timer.visited(contacts.looked, 10 * sizeof(double));  // of both: distance, length, normal
  }
  ScopedTimer timer(step.profile, Stage::kComputeG);
  system::VelocitySystem& system = elasticity.system;
  const std::vector<std::uint8_t> pressed = pressed_solids(step.scene.solids.size(), contacts);
  std::vector<system::SolidRef> refs;
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l) {
    const solid::SolidRest& rest = step.scene.solids[l];
    system::SolidRef ref{&rest, &states[l], &solids[l], {}, {}, {}};
    if (step.scene.params.numerics.damping_by_pace) {
      const double stiffest = std::max(rest.elastic.mu, rest.elastic.lambda + rest.bulk);
      const double pace = step.dt * std::sqrt(stiffest / rest.density) / step.scene.grid.h;
      const double strain = step.dt * solid::largest_strain_rate(step.parallel, states[l], solids[l].carries);
      const double growth = std::max(solids[l].max_det_f, 1.0 / solids[l].min_det_f);
      const double load = solids[l].elastic_energy / (rest.elastic.mu * rest.volume);
      // What meets a solid or something given rests on the grid; what yields has damping of its own.
      const bool meets = pressed[l] || is_pinned(step.scene.pins, l), rests = meets || rest.plastic.yields();
      ref.keeps_volume = !rest.compressible;
      ref.held = shares_while(true, pace, strain, growth);
      ref.loose = meets ? ref.held : shares_while(false, pace, strain, growth);
      ref.walled = rests ? ref.held : system::stiffness_shares_on_walls(pace, growth, load);
    }
    refs.push_back(ref);
  }
  const std::vector<WallRow>& walls = elasticity.walls;
  std::vector<std::uint8_t> held;
  if (!walls.empty()) held = held_components(matter.fixed, walls);
  system.assemble(step.parallel, matter.common.grid, walls.empty() ? matter.fixed : held, refs, matter.mass,
                  velocity.slip, step.dt, grid::slab_axis(matter.common.grid, matter.common.walls));
  tie_rows(elasticity.walls, system);
  fix_prescribed(elasticity.given, system);
  number_rows(system, contacts);
  drop_blocked_rows(elasticity.given, system, contacts);
  elasticity.holds = find_constraints(step.scene.solids.size(), system, meeting_pairs(contacts));
  timer.visited(static_cast<std::uint64_t>(system.unknowns()), 15 * sizeof(Real));
}

void set_right_side(const StepContext& step, SolidStates& states, const SolidWorks& solids, const grid::Grid& common,
                    NodeVelocity& velocity, VelocityEquation& elasticity) {
  if (step.scene.solids.empty()) return;
  ScopedTimer timer(step.profile, Stage::kComputeG);
  system::VelocitySystem& system = elasticity.system;
  std::vector<Real>& momentum = elasticity.momentum;
  system.gather(step.parallel, velocity.field, velocity.slip, elasticity.v_star);
  // momentum = M (v + dt f_ext / m) + dt f_int, f* = momentum + what stands for K v^n
  std::vector<Real> force;
  system.internal_force(step.parallel, force);
  system.multiply_mass(step.parallel, elasticity.v_star, momentum);
  const Real duration = static_cast<Real>(step.dt);
  step.parallel.for_each(system.unknowns(), [&](std::int64_t u) {
    for (std::size_t i = 3 * static_cast<std::size_t>(u); i < 3 * static_cast<std::size_t>(u) + 3; ++i)
      momentum[i] += duration * force[i];
  });
  elasticity.f_star = momentum;
  linalg::multiply(step.parallel, momentum, system.moves(), momentum);
  add_past_stiffness(step, states, solids, common, elasticity);
  add_friction(elasticity.walls, system, {elasticity.f_star, elasticity.momentum});
  elasticity.v_old.clear();
  if (!elasticity.contacts.rows.empty() || !elasticity.given.empty())
    elasticity.v_old = old_velocities(states, solids, common, elasticity);
  timer.visited(static_cast<std::uint64_t>(system.unknowns()), 15 * sizeof(Real));
}

void solve_velocity(const StepContext& step, VelocityEquation& elasticity, NodeVelocity& velocity) {
  if (step.scene.solids.empty()) return;
  ScopedTimer timer(step.profile, Stage::kVelocitySolve);
  const Numerics& numerics = step.scene.params.numerics;
  system::VelocitySystem& system = elasticity.system;
  linalg::SolveStats stats;
  choose_start(step.parallel, elasticity);
  const RightSides right{elasticity.f_star, elasticity.momentum};
  const double negligible =
      negligible_velocity(elasticity.contacts.rows, elasticity.v_star, step.scene.grid.h / step.dt);
  for (int pass = 0; pass == 0 || (pass < kMostPasses && hold_more(elasticity.walls, system, right, elasticity.v_star));
       ++pass) {
    stats =
        system::solve_contact(step.parallel, numerics.velocity_solver, elasticity.f_star, numerics.velocity_tolerance,
                              negligible, system, elasticity.contacts.rows, elasticity.v_star);
    step.info.velocity_iterations += static_cast<std::uint64_t>(stats.iterations);
  }
  system::add_impulses(elasticity.contacts.rows, elasticity.f_star);
  system::add_impulses(elasticity.contacts.rows, elasticity.momentum);
  if (numerics.conserve_momentum) system.conserve_momentum(step.parallel, elasticity.momentum, elasticity.v_star);
  elasticity.holds = find_constraints(step.scene.solids.size(), system, active_pairs(elasticity.contacts));
  if (!elasticity.walls.empty() || !elasticity.given.empty()) {
    std::vector<Vec3d> sums;
    const Reaction reaction = velocity_reaction(step.parallel, elasticity, sums);
    add_velocity_reactions(reaction, elasticity.walls);
    if (elasticity.given.empty()) share_remainder(sums, reaction, elasticity.walls);
    add_pin_reactions(reaction, elasticity.given);
  }
  step.info.velocity_residual = stats.residual;
  step.info.unconverged += !stats.converged;
  write_back(step.parallel, system, elasticity.v_star, velocity);
  timer.visited(static_cast<std::uint64_t>(system.unknowns()), 15 * sizeof(Real));
}

void write_back(const Parallel& parallel, const system::VelocitySystem& system, const std::vector<Real>& x,
                NodeVelocity& velocity) {
  system.scatter(parallel, x, velocity.field, velocity.slip);
  velocity.slip.follow_solid(parallel, velocity.field);
}

}  // namespace efsi::sim
