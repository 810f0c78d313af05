#include "solve/pressure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/kernel.hpp"
#include "contact/solid_contact.hpp"
#include "contact/wall_contact.hpp"
#include "frame/grid_loops.hpp"
#include "given/prescribed.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "solve/bulk.hpp"
#include "solve/carried_pressure.hpp"
#include "solve/pressure_coupling.hpp"
#include "solve/reactions.hpp"
#include "solve/velocity_solve.hpp"
#include "sources/jets.hpp"
#include "sources/volume_source.hpp"
#include "sources/wall_inflow.hpp"
#include "system/divergence.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Without fluid and with nothing but solids that have none there is no pressure.
bool has_pressure(const Scene& scene) {
  bool pressure = scene.params.fluid.present;
  for (const solid::SolidRest& solid : scene.solids) pressure = pressure || solid::has_pressure(solid);
  return pressure;
}

// Padded cells with a pressure; empty: all. In vacuum p = 0 outside the solids; p = 0 in those that have none.
std::vector<std::uint8_t> pressure_cells(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                                         const Matter& matter) {
  std::vector<std::uint8_t> active;
  if (!scene.params.fluid.present) active = matter.owned;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    if (solid::has_pressure(scene.solids[l])) continue;
    if (active.empty()) active.assign(matter.common.grid.padded_count(), 1);
    for_owned_cells(parallel, matter.common.grid, matter.owned, l, states[l].band,
                    [&](std::size_t c, std::size_t) { active[c] = 0; });
  }
  return active;
}

constexpr double kLastHolds = 0.7;  // of f*: the last pressure acts at once where it leaves less
constexpr double kHolds = 4.0;      // penalty of a row in the coupling step over that of the solve, where it does not

// The pressure system of this step and what it shall reach.
void assemble_pressure_system(const StepContext& step, const SolidStates& states, SolidWorks& solids,
                              const Matter& matter, const Holds& holds, system::SlipNodes& slip,
                              PressureEquation& pressure) {
  if (!pressure.lasts) {
    std::vector<std::uint8_t> active;
    if (!step.scene.solids.empty()) active = pressure_cells(step.parallel, step.scene, states, matter);
    close_prescribed_cells(step, states, matter, slip, active);
    compute_compliance(step, states, solids, matter, active, pressure.compliance);
    pressure.system.assemble(step.parallel, matter.common.grid, matter.common.walls, matter.fixed,
                             matter.specific_volume, std::move(active), matter.owned, &slip, !step.scene.pins.empty(),
                             step.scene.params.fluid.viscosity > 0.0, pressure.compliance);
    pressure.lasts = step.scene.solids.empty();
  }
  if (step.scene.params.numerics.volume_source && !step.scene.solids.empty())
    compute_volume_source(step.parallel, step.scene, step.dt, states, holds, matter, solids, pressure.source);
  else
    pressure.source.clear();
  add_bulk_source(step, states, solids, matter, pressure.source);
  add_jets(step, matter, pressure.jets, pressure.source);
}

// Sum of a row of pressures over the cells that no solid owns; counts them.
EFSI_KERNEL double sum_row(int n, const std::uint8_t* owned, const Real* p, std::int64_t& count) {
  double sum[8] = {};
  int own = 0, i = 0;
  for (; i + 8 <= n; i += 8)
    for (int l = 0; l < 8; ++l) {
      own += owned[i + l];
      sum[l] += owned[i + l] ? 0.0 : static_cast<double>(p[i + l]);
    }
  for (; i < n; ++i) {
    own += owned[i];
    sum[0] += owned[i] ? 0.0 : static_cast<double>(p[i]);
  }
  count += n - own;
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
}

// Mean of the pressure over the cells that no solid owns; 0 where there are none.
double fluid_level(const Parallel& parallel, const Grid& g, const std::vector<std::uint8_t>& owned,
                   const std::vector<Real>& p) {
  std::vector<std::int64_t> cells(static_cast<std::size_t>(g.cells[2]), 0);
  const double sum = parallel.sum(g.cells[2], [&](std::int64_t k) {
    double total = 0.0;
    for (int j = 0; j < g.cells[1]; ++j) {
      const std::size_t c = g.padded(0, j, static_cast<int>(k));
      total += sum_row(g.cells[0], owned.data() + c, p.data() + c, cells[static_cast<std::size_t>(k)]);
    }
    return total;
  });
  const std::int64_t count = std::accumulate(cells.begin(), cells.end(), std::int64_t{0});
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

// |left| / |f| of a solid; infinite without forces.
double left_over(const system::VelocitySystem& system, std::size_t solid, const std::vector<Real>& f,
                 const std::vector<Real>& left) {
  double with = 0.0, without = 0.0;
  for (std::size_t i = 3 * system.begin_of(solid); i < 3 * system.begin_of(solid + 1); ++i) {
    without += static_cast<double>(f[i]) * static_cast<double>(f[i]);
    with += static_cast<double>(left[i]) * static_cast<double>(left[i]);
  }
  return without > 0.0 ? std::sqrt(with / without) : std::numeric_limits<double>::infinity();
}

// The solids on which the last pressure already acts: those that it balances, together with the contact impulses of
// the last step, and all that were in contact, so that their rows are sought under it.
std::vector<std::uint8_t> find_held(const StepContext& step, const VelocityEquation& elasticity,
                                    const std::vector<Real>& impulse) {
  const system::VelocitySystem& system = elasticity.system;
  std::vector<std::uint8_t> held = pressed_solids(step.scene.solids.size(), elasticity.contacts);
  std::vector<Real> loaded = elasticity.f_star;
  system::add_impulses(elasticity.contacts.rows, loaded);
  std::vector<Real> left = loaded;
  linalg::add_scaled(step.parallel, left, -1.0, impulse);
  system.fold(step.parallel, left);
  system.fold(step.parallel, loaded);
  for (std::size_t l = 0; l < held.size(); ++l)
    held[l] = solid::has_pressure(step.scene.solids[l]) && (held[l] || left_over(system, l, loaded, left) < kLastHolds);
  return held;
}

// Where the last pressure acts already little is left that could lead rows astray.
void stiffen_rows(const std::vector<std::uint8_t>& held, SolidContacts& contacts) {
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    const auto& [one, other] = contacts.places[r].solids;
    contacts.rows[r].hold = held[one] && held[other] ? 1.0 : kHolds;
  }
}

}  // namespace

void prepare_pressure(const StepContext& step, const SolidStates& states, SolidWorks& solids, const Matter& matter,
                      const std::vector<Real>& last, VelocityEquation& elasticity, NodeVelocity& velocity,
                      PressureEquation& pressure) {
  pressure.takes = false;
  if (!has_pressure(step.scene)) return;
  ScopedTimer timer(step.profile, Stage::kPressureSolve);
  const Grid& g = matter.common.grid;
  assemble_pressure_system(step, states, solids, matter, elasticity.holds, velocity.slip, pressure);
  if (!step.scene.params.numerics.coupling_step || step.scene.solids.empty() || last.empty()) return;
  // Within the solids, over the fluid's level; the fluid's own pressure would feed what it moves.
  const double level = step.scene.params.fluid.present ? fluid_level(step.parallel, g, matter.owned, last) : 0.0;
  std::vector<Real>& q = pressure.system.scratch();  // -dt times it
  const auto last_of = [&](const std::vector<std::uint8_t>& solids_of_it) {
    linalg::fill(step.parallel, q, last.size(), Real(0));
    for (std::size_t l = 0; l < step.scene.solids.size(); ++l) {
      if (!solids_of_it[l]) continue;
      for_owned_cells(step.parallel, g, matter.owned, l, states[l].band, [&](std::size_t c, std::size_t) {
        q[c] = static_cast<Real>(-step.dt * (static_cast<double>(last[c]) - level));
      });
    }
    compute_impulses(step.parallel, g, elasticity.system, velocity.slip, q, pressure.impulse);
  };
  std::vector<std::uint8_t> all(step.scene.solids.size());
  for (std::size_t l = 0; l < all.size(); ++l) all[l] = solid::has_pressure(step.scene.solids[l]);
  last_of(all);
  const std::vector<std::uint8_t> held = find_held(step, elasticity, pressure.impulse);
  stiffen_rows(held, elasticity.contacts);
  pressure.takes = std::find(held.begin(), held.end(), 1) != held.end();
  if (!pressure.takes) return;
  if (held != all) last_of(held);
  const system::VelocitySystem& system = elasticity.system;
  for (std::size_t i = 0; i < pressure.impulse.size(); ++i) {
    elasticity.f_star[i] -= pressure.impulse[i];
    elasticity.momentum[i] -= pressure.impulse[i];
  }
  for (std::size_t l = 0; l < held.size(); ++l)  // the start of the solve: nearly at rest
    for (std::size_t i = 3 * system.begin_of(l); held[l] && i < 3 * system.begin_of(l + 1); ++i)
      if (system.free()[i] > 0) elasticity.v_star[i] = 0;
  pressure.system.project(step.parallel, q, velocity.field);
  linalg::copy(step.parallel, pressure.taken, q);
  deform_by_pressure(step.parallel, g, q, pressure);
}

namespace {

// q := -dt times the last pressure, less what of it has been carried; its carried part takes the place of the last
// pressure.
void begin_pressure(const StepContext& step, const SolidStates& states, const Matter& matter, fluid::FluidState& fluid,
                    PressureEquation& pressure) {
  std::vector<Real>& last = fluid.pressure;
  pressure.carried = fluid.carried_time / step.dt;
  if (step.scene.params.numerics.carries_pressure && !last.empty()) {
    take_carried_pressure(step.parallel, matter.common, states, last, pressure.q);
    linalg::add_scaled(step.parallel, last, -pressure.carried, pressure.q);
  } else {
    pressure.q.clear();
  }
  std::swap(pressure.q, last);
  pressure.q.resize(matter.common.grid.padded_count(), 0);
  linalg::scale(step.parallel, pressure.q, -step.dt);
}

}  // namespace

void solve_pressure(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                    fluid::FluidState& fluid, VelocityEquation& elasticity, NodeVelocity& velocity,
                    PressureEquation& pressure) {
  if (!has_pressure(step.scene)) return;
  const Grid& g = matter.common.grid;
  const Numerics& numerics = step.scene.params.numerics;
  system::DivergenceNorms before;
  double inflow = 0.0;  // through the walls, that the source allows for
  {
    ScopedTimer timer(step.profile, Stage::kPressureSolve);
    balance_inflow(step, solids, matter, velocity, elasticity.walls, inflow, pressure.source);
    before = pressure.system.set_right_side(step.parallel, velocity.field, pressure.source);
    step.info.divergence_before = before.all;
    step.info.divergence_before_solid = before.solid;
  }
  pressure.coupled = 0;
  pressure.left_over.clear();
  pressure.largest = 0.0;
  pressure.led = std::numeric_limits<double>::infinity();
  // A body at rest that the step now serves and now does not would never come to rest.
  std::vector<Real> direction;  // of the next coupling step
  if (pressure.takes || needs_coupling(step.scene, before)) estimate_direction(step, pressure, direction);
  for (int steps = 0;; ++steps) {
    const bool first = steps == 0;
    if (!direction.empty()) {
      couple_pressure(step, states, solids, matter, direction, elasticity, pressure, velocity);
      ScopedTimer timer(step.profile, Stage::kPressureSolve);
      balance_inflow(step, solids, matter, velocity, elasticity.walls, inflow, pressure.source);
      pressure.system.set_right_side(step.parallel, velocity.field, pressure.source);
    }
    ScopedTimer timer(step.profile, Stage::kPressureSolve);
    if (first) {  // the solve starts from the last pressure, minus the parts that already act
      begin_pressure(step, states, matter, fluid, pressure);
      if (pressure.takes) linalg::add_scaled(step.parallel, pressure.q, -1.0, pressure.taken);
    } else {
      linalg::add_scaled(step.parallel, pressure.q, -1.0, direction);
    }
    const linalg::SolveStats stats =
        pressure.system.solve(step.parallel, numerics.pressure_solver, numerics.pressure_tolerance, before, pressure.q);
    step.info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
    step.info.pressure_residual = stats.residual;
    step.info.unconverged += first && !stats.converged;
    timer.visited(g.cell_count(), 12 * sizeof(Real));
    if (steps == kMostCoupling || !strains_much(step, solids, g, velocity.slip, elasticity, pressure)) return;
    linalg::copy(step.parallel, direction, pressure.q);
  }
}

void project_velocity(const StepContext& step, const Grid& g, VelocityEquation& elasticity, PressureEquation& pressure,
                      NodeVelocity& velocity, std::vector<Real>& next) {
  if (!has_pressure(step.scene)) return;
  if (step.scene.params.numerics.stiff_correction && !step.scene.solids.empty()) {
    solve_correction(step, g, velocity.slip, pressure.q, elasticity.system, pressure);
    correct_velocity(step, pressure.q, 1, elasticity, pressure, velocity);
  } else {
    ScopedTimer timer(step.profile, Stage::kPressureSolve);
    pressure.system.project(step.parallel, pressure.q, velocity.field);
  }
  deform_by_pressure(step.parallel, g, pressure.q, pressure);
  ScopedTimer timer(step.profile, Stage::kPressureSolve);
  if (!elasticity.walls.empty()) {
    grid::fill_ghosts(g, pressure.q, Real(0));
    add_projection_reactions(
        [&](std::size_t, std::size_t node) {
          const auto [i, j, k] = g.node_place(node);
          return system::pressure_impulse(g, pressure.q, i, j, k);
        },
        elasticity.walls);
  }
  if (pressure.takes) linalg::add_scaled(step.parallel, pressure.q, 1.0, pressure.taken);  // the q of all the step
  if (!elasticity.walls.empty() || !elasticity.given.empty()) {
    grid::fill_ghosts(g, pressure.q, Real(0));
    const Reaction reaction = pressure_reaction(step.parallel, g, pressure, velocity.slip, elasticity);
    add_pressure_reactions(reaction, elasticity.walls);
    if (!pressure.left_over.empty())
      share_remainder(
          pressure.left_over, [](std::size_t, std::size_t) { return Vec3::Zero(); }, elasticity.walls);
    add_pin_reactions(reaction, elasticity.given);
  }
  linalg::scale(step.parallel, pressure.q, -1.0 / step.dt);
  if (pressure.carried > 0.0) linalg::add_scaled(step.parallel, pressure.q, pressure.carried, next);
  std::swap(pressure.q, next);
  const system::DivergenceNorms after = pressure.system.norms(step.parallel, velocity.field, pressure.source);
  step.info.divergence_after = after.all;
  step.info.divergence_after_solid = after.solid;
}

}  // namespace efsi::sim
