#include "solve/pressure_coupling.hpp"

#include <algorithm>

#include "contact/wall_contact.hpp"
#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "solve/bulk.hpp"
#include "solve/velocity_solve.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kEstimate = 0.2;        // of the divergence that the estimate of a coupling step leaves
constexpr double kWorthCoupling = 0.01;  // of density |div v|^2: the solids over the fluid
constexpr double kStrains = 1e-3;        // of the solids' energy: what the projection may add to that of all
constexpr double kGains = 1e-3;          // of that energy: a coupling step that takes less of its error is the last
constexpr double kLeads = 0.0125;        // cells in a step: motion of a pair of surfaces by the projection
constexpr double kLess = 0.85;  // of that motion before the last coupling step: one that leaves more is the last

// The first part of the preconditioner of Cahouet and Chabat (1988) is the inverse of J M^-1 J^T: a pressure that the
// projection takes, or an estimate of it. This is the second: to a gradient G is M (1 + d2 (2 mu + lambda) / h^3
// J M^-1 J^T), so that its inverse also has d2 (2 mu + lambda) / h^3 in the solids' cells; d2 K: the stiffness in G,
// of an element times its factor.
void add_stiffness(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                   const system::VelocitySystem& elasticity, const std::vector<Real>& compliance,
                   const std::vector<Real>& divergence, std::vector<Real>& direction) {
  const double volume = step.scene.grid.h * step.scene.grid.h * step.scene.grid.h;
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l) {
    const solid::SolidRest& solid = step.scene.solids[l];
    if (!solid::has_pressure(solid)) continue;
    const double modulus = solids[l].element_weight * (2.0 * solid.elastic.mu + solid.elastic.lambda);
    for_owned_cells(step.parallel, matter.common.grid, matter.owned, l, states[l].band,
                    [&](std::size_t c, std::size_t cell) {
                      const auto element = static_cast<std::size_t>(solids[l].element[cell]);
                      const auto factor = static_cast<double>(elasticity.stiffness_factor(l, element));
                      const Real share = static_cast<Real>(factor * modulus / volume);
                      const Real part = share * static_cast<Real>(solids[l].factor(element));
                      const Real given = compliance.empty() ? Real(0) : compliance[c];
                      direction[c] += part / (1 + part * given) * divergence[c];
                    });
  }
}

// How fast subtracting `change` from the velocities leads the surfaces of a pair into each other, at most [m/s].
double led_astray(const std::vector<system::ContactRow>& rows, const std::vector<Real>& change) {
  system::PairMotion motion;
  for (const system::ContactRow& row : rows)
    motion.add(row, row.normal_impulse, std::max(0.0, row.normal.dot(system::row_velocity(row, change))));
  return motion.largest();
}

// What walls have of a step along the last direction: the reaction at nodes above them, which the projection is free to
// move, and of each solid what its solve of G c = J^T q leaves.
void add_wall_reactions(const StepContext& step, const Grid& g, Real length, VelocityEquation& elasticity,
                        PressureEquation& pressure) {
  if (elasticity.walls.empty()) return;
  system::VelocitySystem& system = elasticity.system;
  std::vector<Real> answer;
  system.multiply(step.parallel, pressure.correction, answer);
  if (elasticity.given.empty()) {
    std::vector<Real>& left = pressure.impulse;  // without that of contact
    linalg::add_scaled(step.parallel, left, -1.0, answer);
    linalg::multiply(step.parallel, left, system.moves(), left);
    const std::vector<Vec3d> sums = system.sum_by_solid(step.parallel, left);
    pressure.left_over.resize(sums.size(), Vec3d::Zero());
    for (std::size_t l = 0; l < sums.size(); ++l) pressure.left_over[l] += static_cast<double>(length) * sums[l];
  }
  system.add_penalty_impulses(1, pressure.answers, answer, true);
  grid::fill_ghosts(g, pressure.direction, Real(0));
  const auto reaction = [&](std::size_t solid, std::size_t node) -> Vec3 {
    const auto [i, j, k] = g.node_place(node);
    const std::size_t u = 3 * system.unknown_of(solid, node);
    return length *
           (system::pressure_impulse(g, pressure.direction, i, j, k) - Vec3(answer[u], answer[u + 1], answer[u + 2]));
  };
  add_coupling_reactions(reaction, elasticity.walls);
}

}  // namespace

void compute_impulses(const Parallel& parallel, const Grid& grid, const system::VelocitySystem& system,
                      const system::SlipNodes& slip, std::vector<Real>& q, std::vector<Real>& impulse) {
  grid::fill_ghosts(grid, q, Real(0));
  const std::vector<Vec3> slides = slip.sliding_impulse(parallel, q);
  const auto& nodes = system.nodes();
  impulse.resize(3 * nodes.size());
  parallel.for_each(system.unknowns(), [&](std::int64_t u) {
    const auto [x, y, z] = grid.node_place(nodes[static_cast<std::size_t>(u)]);
    const Vec3 g = system::pressure_impulse(grid, q, x, y, z);
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t i = 3 * static_cast<std::size_t>(u) + a;
      impulse[i] = system.moves()[i] * g[static_cast<Eigen::Index>(a)];
    }
  });
  for (std::size_t t = 0; t < slides.size(); ++t) {
    const std::size_t u = system.unknown_of(slip.nodes()[t].solid, slip.nodes()[t].node);
    for (std::size_t a = 0; a < 3; ++a)
      impulse[3 * u + a] -= system.moves()[3 * u + a] * slides[t][static_cast<Eigen::Index>(a)];
  }
}

void solve_correction(const StepContext& step, const Grid& g, const system::SlipNodes& slip, std::vector<Real>& q,
                      system::VelocitySystem& elasticity, PressureEquation& pressure) {
  ScopedTimer timer(step.profile, Stage::kVelocitySolve);
  const Numerics& numerics = step.scene.params.numerics;
  compute_impulses(step.parallel, g, elasticity, slip, q, pressure.impulse);
  pressure.correction.assign(pressure.impulse.size(), 0);
  // The velocity is the sum of all corrections in the step: what the largest leaves is nothing to the others.
  pressure.largest = std::max(pressure.largest, linalg::norm(step.parallel, pressure.impulse));
  const double tolerance = numerics.velocity_tolerance;
  const linalg::SolveStats stats = elasticity.solve(step.parallel, numerics.velocity_solver, pressure.impulse,
                                                    pressure.correction, tolerance, tolerance * pressure.largest);
  step.info.velocity_iterations += static_cast<std::uint64_t>(stats.iterations);
  step.info.unconverged += !stats.converged;
  pressure.answers = elasticity.penalty_impulses(pressure.correction);
  if (!numerics.conserve_momentum) return;
  elasticity.add_penalty_impulses(-1, pressure.answers, pressure.impulse);
  elasticity.conserve_momentum(step.parallel, pressure.impulse, pressure.correction);
}

void correct_velocity(const StepContext& step, std::vector<Real>& q, Real share, const VelocityEquation& elasticity,
                      PressureEquation& pressure, NodeVelocity& velocity) {
  ScopedTimer timer(step.profile, Stage::kPressureSolve);
  pressure.system.project(step.parallel, q, velocity.field);
  std::vector<Real>& corrected = pressure.corrected;
  corrected.resize(elasticity.v_star.size());
  step.parallel.for_ranges(static_cast<std::int64_t>(corrected.size()), [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
      corrected[i] = elasticity.v_star[i] - share * pressure.correction[i];
  });
  write_back(step.parallel, elasticity.system, corrected, velocity);
}

bool needs_coupling(const Scene& scene, const system::DivergenceNorms& divergence) {
  if (!scene.params.numerics.coupling_step) return false;
  double density = 0.0;
  for (const solid::SolidRest& solid : scene.solids)
    if (solid::has_pressure(solid)) density = std::max(density, solid.density);
  const double fluid = scene.params.fluid.present ? scene.params.fluid.density : 0.0;
  const auto square = [](double x) { return x * x; };
  return density * square(divergence.solid) > kWorthCoupling * fluid * square(divergence.all);
}

void estimate_direction(const StepContext& step, PressureEquation& pressure, std::vector<Real>& direction) {
  ScopedTimer timer(step.profile, Stage::kPressureSolve);
  const linalg::SolveStats stats = pressure.system.estimate(step.parallel, kEstimate, direction);
  step.info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
}

// Conjugate gradients for J A^-1 J^T q = J v* - b, A = G on the nodes that carry solids and M elsewhere. Search
// directions are conjugate by the rule of Polak and Ribiere, since the preconditioner is not the same in each.
void couple_pressure(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     std::vector<Real>& direction, VelocityEquation& elasticity, PressureEquation& pressure,
                     NodeVelocity& velocity) {
  const bool goes_on = pressure.coupled != 0;
  std::vector<Real> answered;  // by elasticity so far
  std::vector<Vec3> impulses;  // of contact
  {
    ScopedTimer timer(step.profile, Stage::kPressureSolve);
    const std::vector<Real>& divergence = pressure.system.right_side();
    add_stiffness(step, states, solids, matter, elasticity.system, pressure.compliance, divergence, direction);
    const auto [slope, along_last] =
        linalg::dots(step.parallel, direction, divergence, goes_on ? pressure.left : divergence);
    if (goes_on) {
      if (pressure.slope > 0.0)
        linalg::add_scaled(step.parallel, direction, std::max(0.0, (slope - along_last) / pressure.slope),
                           pressure.direction);
      elasticity.v_star = pressure.corrected;
      answered = std::move(pressure.correction);
      linalg::scale(step.parallel, answered, static_cast<double>(pressure.coupled));
      impulses = std::move(pressure.answers);
      for (Vec3& impulse : impulses) impulse *= pressure.coupled;
    }
    pressure.slope = slope;
    linalg::copy(step.parallel, pressure.left, divergence);
    linalg::copy(step.parallel, pressure.direction, direction);
  }
  solve_correction(step, matter.common.grid, velocity.slip, direction, elasticity.system, pressure);
  correct_velocity(step, direction, 1, elasticity, pressure, velocity);
  deform_by_pressure(step.parallel, matter.common.grid, direction, pressure);
  const Real length =
      static_cast<Real>(pressure.system.step_length(step.parallel, velocity.field, pressure.source, direction));
  pressure.gain = 0.5 * length * pressure.slope;
  add_wall_reactions(step, matter.common.grid, length, elasticity, pressure);
  if (!pressure.takes) linalg::fill(step.parallel, pressure.taken, direction.size(), Real(0));
  pressure.takes = true;
  linalg::add_scaled(step.parallel, pressure.taken, length, direction);
  linalg::scale(step.parallel, direction, length - 1);
  deform_by_pressure(step.parallel, matter.common.grid, direction, pressure);
  correct_velocity(step, direction, length, elasticity, pressure, velocity);
  linalg::add_scaled(step.parallel, direction, 1.0, pressure.direction);
  pressure.coupled = length;
  if (!goes_on) return;
  linalg::add_scaled(step.parallel, answered, length, pressure.correction);
  for (std::size_t p = 0; p < impulses.size(); ++p) impulses[p] += length * pressure.answers[p];
  pressure.correction = std::move(answered);
  pressure.answers = std::move(impulses);
  pressure.coupled = 1;
}

bool strains_much(const StepContext& step, const SolidWorks& solids, const Grid& g, const system::SlipNodes& slip,
                  VelocityEquation& elasticity, PressureEquation& pressure) {
  if (!step.scene.params.numerics.coupling_step || step.scene.solids.empty()) return false;
  system::VelocitySystem& system = elasticity.system;
  const std::vector<Real>& v = pressure.coupled != 0 ? pressure.corrected : elasticity.v_star;
  std::vector<Real> change, moved;
  system.multiply_mass(step.parallel, v, moved);
  double energy = 0.5 * linalg::dot(step.parallel, v, moved);
  for (const solid::SolidWork& solid : solids) energy += solid.elastic_energy;
  const double taken = 0.5 * linalg::dot(step.parallel, pressure.q, pressure.system.right_side());
  compute_impulses(step.parallel, g, system, slip, pressure.q, pressure.impulse);
  system.divide_by_mass(step.parallel, pressure.impulse, change);
  for (const WallRow& row : elasticity.walls)  // the pressure moves no node on a wall
    if (row.on_wall) change[3 * system.unknown_of(row.solid, row.node) + static_cast<std::size_t>(row.axis)] = 0;
  const double before = pressure.led;
  pressure.led = led_astray(elasticity.contacts.rows, change);
  if (pressure.led > kLeads * g.h / step.dt && pressure.led < kLess * before) return true;
  if (pressure.coupled != 0 && pressure.gain < kGains * energy) return false;
  std::vector<Real> inertia;
  system.multiply(step.parallel, change, moved);
  system.multiply_mass(step.parallel, change, inertia);
  linalg::add_scaled(step.parallel, moved, -1.0, inertia);  // dt^2 K of the change
  return 0.5 * linalg::dot(step.parallel, change, moved) > taken + kStrains * energy;
}

}  // namespace efsi::sim
