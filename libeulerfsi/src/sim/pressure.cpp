#include "sim/pressure.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/kernel.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "sim/grid_loops.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Without fluid and with nothing but compressible solids nothing is incompressible.
bool has_pressure(const Scene& scene) {
  bool pressure = scene.params.fluid.present;
  for (const solid::SolidRest& solid : scene.solids) pressure = pressure || !solid.compressible;
  return pressure;
}

// Padded cells with a pressure; empty: all. In vacuum p = 0 outside the solids, in compressible ones p = 0 inside.
std::vector<std::uint8_t> pressure_cells(const Parallel& parallel, const Scene& scene, const State& state,
                                         const Workspace& work) {
  std::vector<std::uint8_t> active;
  if (!scene.params.fluid.present) active = work.owned;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    if (!scene.solids[l].compressible) continue;
    if (active.empty()) active.assign(work.common.grid.padded_count(), 1);
    for_owned_cells(parallel, state, work, l, [&](std::size_t c) { active[c] = 0; });
  }
  return active;
}

constexpr double kLargestGrowth = 0.02;  // of a solid's volume in a step, to make up for what its surface has lost
constexpr double kFilm = 0.005;          // cells: thickness over a free surface; its loss under a load stays below that
constexpr double kAhead = 0.5;           // of what the last step lost: losses last for many steps

// What a solid as a whole is asked to gain in this step, over its volume at rest: what its mesh has lost and part of
// what this step will lose. While nothing holds the solid a film does not count.
double asked_volume(const Scene& scene, const State& state, const Workspace& work, std::size_t l, double volume) {
  double lost = 1.0 - volume;
  if (!work.velocity_system.touches(l)) {
    const double film = kFilm * scene.grid.h * scene.solids[l].area / scene.solids[l].volume;
    lost -= std::clamp(lost, -film, film);
  }
  if (lost == 0.0) return 0.0;
  return std::clamp(lost + kAhead * state.solids[l].leak, -kLargestGrowth, kLargestGrowth);
}

// b of Eq. 11: where det F has drifted from 1 the solid is asked to grow or shrink back, slowly, since det F is rough
// at the surface. What a solid has lost as a whole its inside gains in the same step. What solids gain the fluid of the
// box loses, so that the sum vanishes.
void compute_volume_source(const Parallel& parallel, const Scene& scene, const State& state, double dt,
                           Workspace& work) {
  const Grid& g = work.common.grid;
  linalg::fill(parallel, work.source, g.padded_count(), Real(0));
  const double tau = std::max(4.0 * dt, 1.0 / 24.0), limit = 0.1 / dt;
  double fluid_cells = static_cast<double>(g.cell_count());
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    solid::SolidWork& solid = work.solids[l];
    solid.next_volume = 0.0;
    fluid_cells -= static_cast<double>(solid.element_cell.size());
    if (scene.solids[l].compressible) continue;
    double growth = 0.0;
    if (state.solids[l].whole && solid::encloses(scene.solids[l])) {
      const double volume = solid::volume_ratio(scene.solids[l], state.solids[l]);
      const double asked = asked_volume(scene, state, work, l, volume);
      solid.next_volume = volume + asked;
      growth = asked / dt;
    }
    for_band_cells(parallel, g, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
      if (solid.element[c] < 0) return;
      const double det = static_cast<double>(solid.volume_ratio[c]);
      const double rate = growth + std::clamp((1.0 - det) / (det * tau), -limit, limit);
      work.source[g.padded(i, j, k)] = static_cast<Real>(rate * static_cast<double>(solid.fraction[c]));
    });
  }
  if (!scene.params.fluid.present || scene.params.walls.any_open() || fluid_cells < 1.0) return;
  const double total = parallel.sum(g.cells[2], [&](std::int64_t k) {
    double sum = 0.0;
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) sum += static_cast<double>(work.source[g.padded(i, j, static_cast<int>(k))]);
    return sum;
  });
  const Real share = static_cast<Real>(total / fluid_cells);
  parallel.for_each(g.cells[2], [&](std::int64_t k) {
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.padded(i, j, static_cast<int>(k));
        if (!work.owned[c]) work.source[c] -= share;
      }
  });
}

constexpr double kLastHolds = 0.7;       // of f*: the last pressure acts at once where it leaves less
constexpr double kEstimate = 0.2;        // of the divergence that the estimate of a coupling step leaves
constexpr double kWorthCoupling = 0.01;  // of density |div v|^2: the solids over the fluid

// Whether elasticity has to answer to the pressure: where the divergence of the fluid outweighs that of the solids by
// far, as in free flight, it hardly does.
bool needs_coupling(const Scene& scene, const system::DivergenceNorms& divergence) {
  if (!scene.params.numerics.coupling_step) return false;
  double density = 0.0;
  for (const solid::SolidRest& solid : scene.solids)
    if (!solid.compressible) density = std::max(density, solid.density);
  const double fluid = scene.params.fluid.present ? scene.params.fluid.density : 0.0;
  const auto square = [](double x) { return x * x; };
  return density * square(divergence.solid) > kWorthCoupling * fluid * square(divergence.all);
}

// The pressure system of this step and what it shall reach.
void assemble_pressure_system(const Parallel& parallel, const Scene& scene, double dt, const State& state,
                              Workspace& work) {
  if (!work.uniform_ready) {
    std::vector<std::uint8_t> active;
    if (!scene.solids.empty()) active = pressure_cells(parallel, scene, state, work);
    work.pressure_system.assemble(parallel, work.common.grid, work.common.walls, work.fixed, work.specific_volume,
                                  std::move(active), work.owned, &work.slip);
    work.uniform_ready = scene.solids.empty();
  }
  if (scene.params.numerics.volume_source && !scene.solids.empty())
    compute_volume_source(parallel, scene, state, dt, work);
  else
    work.source.clear();
}

// J^T q on the unknowns, where walls leave them free. Fills the ghosts of q.
void compute_impulses(const Parallel& parallel, const Workspace& work, std::vector<Real>& q,
                      std::vector<Real>& impulse) {
  const auto& system = work.velocity_system;
  const Grid& grid = work.common.grid;
  grid::fill_ghosts(grid, q, Real(0));
  const std::vector<Vec3> slides = work.slip.sliding_impulse(parallel, q);
  const auto& nodes = system.nodes();
  impulse.resize(3 * nodes.size());
  parallel.for_each(system.unknowns(), [&](std::int64_t u) {
    const auto [x, y, z] = grid.node_place(nodes[static_cast<std::size_t>(u)]);
    const Vec3 g = system::pressure_impulse(grid, q, x, y, z);
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t i = 3 * static_cast<std::size_t>(u) + a;
      impulse[i] = system.free()[i] * g[static_cast<Eigen::Index>(a)];
    }
  });
  for (std::size_t t = 0; t < slides.size(); ++t) {
    const std::size_t u = system.unknown_of(work.slip.nodes()[t].node);
    for (std::size_t a = 0; a < 3; ++a) impulse[3 * u + a] -= slides[t][static_cast<Eigen::Index>(a)];
  }
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

}  // namespace

void prepare_pressure(const Parallel& parallel, const Scene& scene, double dt, const State& state, Workspace& work,
                      Profile& profile) {
  work.takes = false;
  if (!has_pressure(scene)) return;
  ScopedTimer timer(profile, Stage::kPressureSolve);
  assemble_pressure_system(parallel, scene, dt, state, work);
  const std::vector<Real>& p = state.fluid.pressure;
  if (!scene.params.numerics.coupling_step || scene.solids.empty() || p.empty()) return;
  // Within the solids, over the fluid's level; the fluid's own pressure would feed what it moves.
  const double level = scene.params.fluid.present ? fluid_level(parallel, work.common.grid, work.owned, p) : 0.0;
  std::vector<Real>& q = work.pressure_system.scratch();
  linalg::fill(parallel, q, p.size(), Real(0));
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    if (scene.solids[l].compressible) continue;
    for_owned_cells(parallel, state, work, l,
                    [&](std::size_t c) { q[c] = static_cast<Real>(-dt * (static_cast<double>(p[c]) - level)); });
  }
  std::vector<Real>& impulse = work.correction;
  compute_impulses(parallel, work, q, impulse);
  double with = 0.0, without = 0.0;
  for (std::size_t i = 0; i < impulse.size(); ++i) {
    const double f = static_cast<double>(work.velocity_system.free()[i]) * static_cast<double>(work.f_star[i]);
    without += f * f;
    with += (f - static_cast<double>(impulse[i])) * (f - static_cast<double>(impulse[i]));
  }
  work.takes = with < kLastHolds * kLastHolds * without;
  if (!work.takes) return;
  for (std::size_t i = 0; i < impulse.size(); ++i) {
    work.f_star[i] -= impulse[i];
    work.momentum[i] -= impulse[i];
  }
  std::fill(work.v_star.begin(), work.v_star.end(), Real(0));  // the start of the solve: nearly at rest
  work.pressure_system.project(parallel, q, work.velocity);
  linalg::copy(parallel, work.taken, q);
}

namespace {

// Eq. 13: work.correction = G^-1 J^T q on the nodes that carry solids.
void solve_correction(const Parallel& parallel, const Scene& scene, std::vector<Real>& q, Workspace& work,
                      Profile& profile, StepInfo& info) {
  ScopedTimer timer(profile, Stage::kVelocitySolve);
  const Numerics& numerics = scene.params.numerics;
  auto& system = work.velocity_system;
  std::vector<Real>& impulse = work.f_star;
  compute_impulses(parallel, work, q, impulse);
  work.correction.assign(impulse.size(), 0);
  const linalg::SolveStats stats =
      system.solve(parallel, numerics.velocity_solver, impulse, work.correction, numerics.velocity_tolerance);
  info.velocity_iterations += static_cast<std::uint64_t>(stats.iterations);
  info.unconverged += !stats.converged;
  if (numerics.conserve_momentum) system.conserve_momentum(parallel, impulse, work.correction);
}

// v -= M^-1 J^T q, but v = v* - share G^-1 J^T q on the nodes that carry solids.
void correct_velocity(const Parallel& parallel, std::vector<Real>& q, Real share, Workspace& work, Profile& profile) {
  ScopedTimer timer(profile, Stage::kPressureSolve);
  work.pressure_system.project(parallel, q, work.velocity);
  std::vector<Real>& corrected = work.f_star;
  parallel.for_ranges(static_cast<std::int64_t>(corrected.size()), [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
      corrected[i] = work.v_star[i] - share * work.correction[i];
  });
  {
    const system::SolidView view(parallel, work.slip, work.velocity);
    work.velocity_system.scatter(parallel, corrected, work.velocity);
  }
  work.slip.follow_solid(parallel, work.velocity);
}

// One step of conjugate gradients towards the pressure of J A^-1 J^T q = J v* - b, A = G on the nodes that carry solids
// and M elsewhere, with the preconditioner of Cahouet and Chabat (1988): to a gradient G is M (1 + d2 (2 mu + lambda) /
// h^3 J M^-1 J^T), so that the inverse is that of J M^-1 J^T, roughly, and d2 (2 mu + lambda) / h^3 in the solids'
// cells; d2 K: the stiffness in G. What it leaves the projection takes.
void couple_pressure(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work,
                     Profile& profile, StepInfo& info) {
  const double volume = scene.grid.h * scene.grid.h * scene.grid.h;
  std::vector<Real> q;
  {
    ScopedTimer timer(profile, Stage::kPressureSolve);
    const linalg::SolveStats stats = work.pressure_system.estimate(parallel, kEstimate, q);
    info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
    for (std::size_t l = 0; l < scene.solids.size(); ++l) {
      const solid::SolidRest& solid = scene.solids[l];
      if (solid.compressible) continue;
      const double modulus = work.solids[l].element_weight * (2.0 * solid.elastic.mu + solid.elastic.lambda);
      const Real share =
          static_cast<Real>(static_cast<double>(work.velocity_system.stiffness_factor(l)) * modulus / volume);
      for_owned_cells(parallel, state, work, l,
                      [&](std::size_t c) { q[c] += share * work.pressure_system.right_side()[c]; });
    }
  }
  solve_correction(parallel, scene, q, work, profile, info);
  correct_velocity(parallel, q, 1, work, profile);
  const Real length = static_cast<Real>(work.pressure_system.step_length(parallel, work.velocity, work.source, q));
  if (!work.takes) linalg::fill(parallel, work.taken, q.size(), Real(0));
  work.takes = true;
  linalg::add_scaled(parallel, work.taken, length, q);
  linalg::scale(parallel, q, length - 1);
  correct_velocity(parallel, q, length, work, profile);
}

}  // namespace

void solve_pressure(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                    Profile& profile, StepInfo& info) {
  if (!has_pressure(scene)) return;
  const Numerics& numerics = scene.params.numerics;
  system::DivergenceNorms before;
  {
    ScopedTimer timer(profile, Stage::kPressureSolve);
    before = work.pressure_system.set_right_side(parallel, work.velocity, work.source);
    info.divergence_before = before.all;
    info.divergence_before_solid = before.solid;
  }
  // A body at rest that the step now serves and now does not would never come to rest.
  const bool couples = work.takes || needs_coupling(scene, before);
  if (couples) couple_pressure(parallel, scene, state, work, profile, info);
  ScopedTimer timer(profile, Stage::kPressureSolve);
  if (couples) work.pressure_system.set_right_side(parallel, work.velocity, work.source);
  // Holds the pressure between steps and the multiplier of J during one: J^T is minus the gradient, so q = -dt p. The
  // coupling step's part is added after the projection.
  std::vector<Real>& q = state.fluid.pressure;
  q.resize(work.common.grid.padded_count(), 0);
  linalg::scale(parallel, q, -dt);
  if (work.takes) linalg::add_scaled(parallel, q, -1.0, work.taken);
  const linalg::SolveStats stats =
      work.pressure_system.solve(parallel, numerics.pressure_solver, numerics.pressure_tolerance, before, q);
  info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
  info.pressure_residual = stats.residual;
  info.unconverged += !stats.converged;
  timer.visited(work.common.grid.cell_count(), 12 * sizeof(Real));
}

void project_velocity(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                      Profile& profile, StepInfo& info) {
  if (!has_pressure(scene)) return;
  std::vector<Real>& q = state.fluid.pressure;
  if (scene.params.numerics.stiff_correction && !scene.solids.empty()) {
    solve_correction(parallel, scene, q, work, profile, info);
    correct_velocity(parallel, q, 1, work, profile);
  } else {
    ScopedTimer timer(profile, Stage::kPressureSolve);
    work.pressure_system.project(parallel, q, work.velocity);
  }
  ScopedTimer timer(profile, Stage::kPressureSolve);
  if (work.takes) linalg::add_scaled(parallel, q, 1.0, work.taken);
  linalg::scale(parallel, q, -1.0 / dt);
  const system::DivergenceNorms after = work.pressure_system.norms(parallel, work.velocity, work.source);
  info.divergence_after = after.all;
  info.divergence_after_solid = after.solid;
}

}  // namespace efsi::sim
