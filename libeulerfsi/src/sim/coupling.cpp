#include "sim/coupling.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/kernel.hpp"
#include "fluid/advect.hpp"
#include "fluid/forces.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "sim/grid_loops.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/repair.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

EFSI_KERNEL Real largest(std::size_t n, const Real* values) {
  Real top = 0;
#pragma omp simd reduction(max : top)
  for (std::size_t i = 0; i < n; ++i) top = std::max(top, std::abs(values[i]));
  return top;
}

// Cells of the grid that touch a node.
int adjacent_cells(const Grid& g, int i, int j, int k) {
  const int index[3] = {i, j, k};
  int cells = 1;
  for (std::size_t a = 0; a < 3; ++a) cells *= g.periodic[a] || (index[a] > 0 && index[a] < g.cells[a]) ? 2 : 1;
  return cells;
}

void find_owned_cells(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  work.owned.assign(scene.solids.empty() ? 0 : work.common.grid.padded_count(), 0);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_owned_cells(parallel, state, work, l, [&](std::size_t c) { work.owned[c] = 1; });
}

// Which components walls fix: by the faces, less where a solid slides.
void find_fixed_components(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  const auto& [g, walls] = work.common;
  work.fixed.resize(g.node_count(), 0);
  for_face_nodes(parallel, g, [&](std::size_t n, int i, int j, int k) {
    work.fixed[n] = static_cast<std::uint8_t>(grid::fixed_components(g, walls, i, j, k));
  });
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const Grid& band = state.solids[l].band.grid;
    const Vec3i lo = grid::offset(band, g);
    for_face_nodes(parallel, band, [&](std::size_t local, int i, int j, int k) {
      if (!work.solids[l].carries[local]) return;
      const int gi = i + lo[0], gj = j + lo[1], gk = k + lo[2];
      const std::size_t n = g.node(gi, gj, gk);
      if (work.fixed[n]) work.fixed[n] = grid::fixed_for_solid(g, walls, gi, gj, gk);
    });
  }
}

// Walls fix nodes on the faces only.
void enforce_walls(const Parallel& parallel, const Grid& g, const std::vector<std::uint8_t>& fixed,
                   grid::VectorField& velocity) {
  for_face_nodes(parallel, g, [&](std::size_t n, int, int, int) {
    for (std::size_t a = 0; a < 3; ++a)
      if (fixed[n] & (1u << a)) velocity.c[a][n] = 0;
  });
}

// What the fluid weighs at the nodes, and what depends on where the solids are.
void combine_masses(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work,
                    ScopedTimer& timer) {
  const Grid& g = work.common.grid;
  const bool solids = !scene.solids.empty();
  if (!solids && work.uniform_ready) return;
  find_fixed_components(parallel, scene, state, work);
  if (!solids) return;  // the density says it all
  const double h3 = g.h * g.h * g.h;
  const Real fluid_density = scene.params.fluid.present ? static_cast<Real>(scene.params.fluid.density) : Real(0);

  // The fluid fills what the solids leave free.
  linalg::fill(parallel, work.cell_fraction, g.cell_count(), Real(0));
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_cells(parallel, g, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
      Real& fraction = work.cell_fraction[g.cell(i, j, k)];
      fraction = std::min(Real(1), fraction + work.solids[l].fraction[c]);
    });
  work.mass.resize(g.node_count());
  const auto full_mass = [&](int i, int j, int k) {
    return static_cast<Real>(static_cast<double>(fluid_density) * h3 / 8.0 * adjacent_cells(g, i, j, k));
  };
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk), last = g.cells[0];
    for (int j = 0; j <= g.cells[1]; ++j) {
      Real* row = work.mass.data() + g.node(0, j, k);
      row[0] = full_mass(0, j, k);
      std::fill(row + 1, row + last, full_mass(1, j, k));
      row[last] = full_mass(last, j, k);
    }
  });
  // Around the solids: the fluid's share of each of the 8 cells.
  const auto cell_at = [&](int i, int j, int k) -> std::int64_t {
    int q[3] = {i, j, k};
    for (std::size_t a = 0; a < 3; ++a) {
      const int n = g.cells[a];
      if (g.periodic[a]) q[a] = (q[a] + n) % n;
      if (q[a] < 0 || q[a] >= n) return -1;
    }
    return static_cast<std::int64_t>(g.cell(q[0], q[1], q[2]));
  };
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, state.solids[l].band, [&](std::size_t, int i, int j, int k) {
      double share = 0.0;
      bool any = false;
      for (const auto& corner : grid::kCorner) {
        const std::int64_t c = cell_at(i - corner[0], j - corner[1], k - corner[2]);
        if (c < 0) continue;
        const double fraction = static_cast<double>(work.cell_fraction[static_cast<std::size_t>(c)]);
        any = any || fraction > 0.0;
        share += 1.0 - fraction;
      }
      if (any) work.mass[g.node(i, j, k)] = static_cast<Real>(static_cast<double>(fluid_density) * h3 / 8.0 * share);
    });
  timer.visited(g.node_count(), 2 * sizeof(Real));
}

// The nodes at the surfaces of solids along which the fluid slips: not at walls, nor where solids meet, nor at gaps of
// less than a cell, whose corners all belong to solids. Before the masses of solids are added to work.mass.
void find_slip_nodes(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  work.slip = {};
  if (!scene.params.numerics.fluid_slips || !scene.params.fluid.present || scene.solids.empty()) return;
  const Grid& g = work.common.grid;
  std::vector<std::uint8_t> carriers(g.node_count(), 0);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, state.solids[l].band, [&](std::size_t local, int i, int j, int k) {
      if (work.solids[l].carries[local]) ++carriers[g.node(i, j, k)];
    });
  const auto is_gap = [&](int i, int j, int k) {
    return std::all_of(std::begin(grid::kCorner), std::end(grid::kCorner),
                       [&](const auto& c) { return carriers[g.node(i + c[0], j + c[1], k + c[2])] > 0; });
  };
  std::vector<std::vector<system::SlipNode>> planes(static_cast<std::size_t>(g.cells[2] + 1));
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, state.solids[l].band, [&](std::size_t local, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      const bool face = i == 0 || j == 0 || k == 0 || i == g.cells[0] || j == g.cells[1] || k == g.cells[2];
      const Real solid_mass = work.solids[l].mass[local], fluid_mass = work.mass[n];
      if (face || carriers[n] != 1 || !work.solids[l].carries[local] || !(solid_mass > 0) || !(fluid_mass > 0)) return;
      system::SlipNode node{n, i, j, k, l, 0, Vec3::Zero(), solid_mass, fluid_mass};
      for (std::size_t a = 0; a < 8; ++a) {
        const auto& corner = grid::kCorner[a];
        if (!work.owned[g.padded(i - corner[0], j - corner[1], k - corner[2])]) {
          if (is_gap(i - corner[0], j - corner[1], k - corner[2])) return;
          continue;
        }
        node.solid_cells = static_cast<std::uint8_t>(node.solid_cells | (1u << a));
      }
      node.normal = system::stair_normal(node.solid_cells);
      if (!node.normal.isZero()) planes[static_cast<std::size_t>(k)].push_back(node);
    });
  std::vector<system::SlipNode> nodes;
  for (const auto& plane : planes) nodes.insert(nodes.end(), plane.begin(), plane.end());
  work.slip = system::SlipNodes(parallel, g, std::move(nodes));
}

// 1 along periodic axes of a box from which nothing flows out.
Vec3d conserved_axes(const Scene& scene) {
  const grid::Walls& walls = scene.params.walls;
  Vec3d axes = Vec3d::Zero();
  if (!scene.params.fluid.present || walls.any_open()) return axes;
  for (int a = 0; a < 3; ++a) axes[a] = walls.lower(a) == grid::Wall::kPeriodic ? 1.0 : 0.0;
  return axes;
}

// Sum of the fluid's mass and momentum over the nodes: work.mass holds what is not solid.
struct FluidSums {
  double mass = 0.0;
  Vec3d momentum = Vec3d::Zero();
};
FluidSums sum_fluid(const Parallel& parallel, const Grid& g, const std::vector<Real>& mass,
                    const grid::VectorField& velocity) {
  int end[3];  // the last node of a periodic axis is the first one again
  for (std::size_t a = 0; a < 3; ++a) end[a] = g.cells[a] + (g.periodic[a] ? 0 : 1);
  std::vector<FluidSums> planes(static_cast<std::size_t>(end[2]));
  parallel.for_each(end[2], [&](std::int64_t kk) {
    FluidSums& s = planes[static_cast<std::size_t>(kk)];
    const int k = static_cast<int>(kk);
    for (int j = 0; j < end[1]; ++j)
      for (int i = 0; i < end[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const double m = static_cast<double>(mass[n]);
        s.mass += m;
        s.momentum += m * velocity.at(n).cast<double>();
      }
  });
  FluidSums total;
  for (const FluidSums& s : planes) {
    total.mass += s.mass;
    total.momentum += s.momentum;
  }
  return total;
}

// The common grid follows the solids, and with it what is kept of it.
void follow_solids(const Scene& scene, State& state, Workspace& work) {
  const Window window = choose_window(scene.params, scene.grid, state.solids, work.solids);
  const CommonGrid common = cut(scene.params, scene.grid, window);
  if (common.grid.cells != work.common.grid.cells) work.fixed.clear();
  work.common = common;
  if (window == state.window) return;
  state.fluid.pressure = move_cells(state.fluid.pressure, state.window, window);
  state.window = window;
}

// What the masses of all solids make of the grid they share.
void share_nodes(const Parallel& parallel, const Scene& scene, State& state, Workspace& work, Profile& profile) {
  ScopedTimer timer(profile, Stage::kFluidForces);
  follow_solids(scene, state, work);
  combine_masses(parallel, scene, state, work, timer);
  find_owned_cells(parallel, scene, state, work);
  find_slip_nodes(parallel, scene, state, work);
}

}  // namespace

void compute_solid_masses(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work,
                          Profile& profile) {
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    ScopedTimer timer(profile, Stage::kSolidMass);
    solid::compute_mass(parallel, scene.solids[l], state.solids[l], work.solids[l]);
    timer.visited(work.solids[l].mass.size(), 5 * sizeof(Real));
  }
}

void compute_masses(const Parallel& parallel, const Scene& scene, State& state, Workspace& work, Profile& profile) {
  compute_solid_masses(parallel, scene, state, work, profile);
  share_nodes(parallel, scene, state, work, profile);
  work.masses_ready = true;
}

std::uint64_t repair_maps(const Parallel& parallel, const Scene& scene, State& state, Workspace& work,
                          Profile& profile) {
  std::uint64_t cells = 0;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    ScopedTimer timer(profile, Stage::kSolidMass);
    cells += solid::repair_map(parallel, scene.solids[l], state.solids[l], work.solids[l]);
  }
  if (cells > 0) share_nodes(parallel, scene, state, work, profile);
  return cells;
}

namespace {

constexpr double kMostLift = 1.0;  // of its weight

}  // namespace

Weight weight_in_step(const Scene& scene, double dt, const Workspace& work) {
  const bool fluid = scene.params.fluid.present;
  double ambient = fluid ? scene.params.fluid.density : 0.0;
  for (const solid::SolidRest& solid : scene.solids) ambient = std::min(ambient, (1.0 + kMostLift) * solid.density);
  const Vec3d kick = dt * scene.params.gravity;
  Weight weight;
  weight.fluid = ((fluid ? 1.0 - ambient / scene.params.fluid.density : 0.0) * kick).cast<Real>();
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidRest& rest = scene.solids[l];
    const double mass = work.solids[l].total_mass;
    const double density = rest.compressible && mass > 0.0 ? mass / work.solids[l].volume : rest.density;
    weight.solids.push_back(((1.0 - ambient / density) * kick).cast<Real>());
  }
  return weight;
}

void combine_velocities(const Parallel& parallel, const Scene& scene, const Weight& weight, State& state,
                        Workspace& work) {
  const Grid& g = work.common.grid;
  if (scene.params.fluid.present)
    std::swap(work.velocity.c, state.fluid.velocity.c);  // the advection gives it back
  else
    for (auto& component : work.velocity.c) linalg::fill(parallel, component, g.node_count(), Real(0));
  if (!weight.fluid.isZero(0))
    for (std::size_t a = 0; a < 3; ++a) {
      Real* v = work.velocity.c[a].data();
      const Real kick = weight.fluid[static_cast<Eigen::Index>(a)];
      parallel.for_each(static_cast<std::int64_t>(g.node_count()), [=](std::int64_t n) { v[n] += kick; });
    }
  std::vector<Vec3> fluid_velocity;  // at slip nodes, where nothing is mixed
  for (const system::SlipNode& n : work.slip.nodes()) fluid_velocity.push_back(work.velocity.at(n.node));
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidState& solid = state.solids[l];
    const Real* push = weight.solids[l].data();
    for_band_nodes(parallel, g, solid.band, [&](std::size_t local, int i, int j, int k) {
      const Real m = work.solids[l].mass[local];
      if (!(m > 0)) return;
      const std::size_t n = g.node(i, j, k);
      const Real total = work.mass[n] + m;
      for (std::size_t a = 0; a < 3; ++a)
        work.velocity.c[a][n] = (work.mass[n] * work.velocity.c[a][n] + m * (solid.v.c[a][local] + push[a])) / total;
      work.mass[n] = total;
    });
  }
  for (std::size_t t = 0; t < fluid_velocity.size(); ++t) {
    const system::SlipNode& n = work.slip.nodes()[t];
    const solid::SolidState& solid = state.solids[n.solid];
    const Vec3i lo = grid::offset(solid.band.grid, g);
    work.slip.solid_velocity()[t] =
        weight.solids[n.solid] + solid.v.at(solid.band.grid.node(n.i - lo[0], n.j - lo[1], n.k - lo[2]));
    work.velocity.set(n.node, fluid_velocity[t]);
  }
  if (scene.solids.empty() && work.uniform_ready) return;
  const double h3 = g.h * g.h * g.h;
  const Real fluid_volume = scene.params.fluid.present ? static_cast<Real>(1.0 / scene.params.fluid.density) : Real(0);
  linalg::fill(parallel, work.specific_volume, g.node_count(), fluid_volume);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, state.solids[l].band, [&](std::size_t, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      const double full = h3 / 8.0 * adjacent_cells(g, i, j, k);
      const double m = static_cast<double>(work.mass[n]);
      const Real exact = static_cast<Real>(m > 0.0 ? full / m : 0.0);
      const bool pure = static_cast<double>(fluid_volume) > 0.0 &&
                        std::abs(static_cast<double>(exact) / static_cast<double>(fluid_volume) - 1.0) < 1e-5;
      work.specific_volume[n] = pure ? fluid_volume : exact;
    });
}

void add_external_forces(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                         ScopedTimer& timer) {
  const Grid& g = work.common.grid;
  if (scene.params.fluid.present)
    fluid::apply_emitters(parallel, g, scene.emitters, state.time, state.fluid, work.velocity);
  const std::uint64_t visited = fluid::add_body_forces(parallel, g, scene.params.fluid, state.fluid,
                                                       scene.params.gravity, dt, work.specific_volume, work.velocity);
  timer.visited(visited, 4 * sizeof(Real));
}

void impose_walls(const Parallel& parallel, Workspace& work) {
  work.slip.share_normal(parallel, work.velocity);
  enforce_walls(parallel, work.common.grid, work.fixed, work.velocity);
}

void assemble_velocity_system(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                              Profile& profile) {
  if (scene.solids.empty()) return;
  ScopedTimer timer(profile, Stage::kComputeG);
  std::vector<system::SolidRef> refs;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidRest& rest = scene.solids[l];
    system::SolidRef ref{&rest, &state.solids[l], &work.solids[l], {}, {}};
    if (scene.params.numerics.stiffness_by_pace) {
      const double pace = dt * std::sqrt(rest.elastic.mu / rest.density) / scene.grid.h;
      const double strain = dt * solid::largest_strain_rate(parallel, state.solids[l], work.solids[l].carries);
      const double growth = std::max(ref.work->max_det_f, 1.0 / ref.work->min_det_f);
      ref.loose = system::stiffness_shares(pace, strain, growth);
      ref.held = system::stiffness_shares(pace, std::numeric_limits<double>::infinity(), growth);
    }
    refs.push_back(ref);
  }
  work.velocity_system.assemble(parallel, work.common.grid, work.fixed, refs, work.mass, work.slip, dt);
  // momentum = M (v + dt f_ext / m) + dt f_int, f* = momentum + what stands for K v^n
  {
    const system::SolidView view(parallel, work.slip, work.velocity);
    work.velocity_system.gather(parallel, work.velocity, work.v_star);
  }
  work.velocity_system.internal_force(parallel, work.f_star);
  work.velocity_system.multiply_mass(parallel, work.v_star, work.momentum);
  const auto& free = work.velocity_system.free();
  const Real step = static_cast<Real>(dt);
  parallel.for_each(work.velocity_system.unknowns(), [&](std::int64_t u) {
    for (std::size_t i = 3 * static_cast<std::size_t>(u); i < 3 * static_cast<std::size_t>(u) + 3; ++i)
      work.momentum[i] = free[i] * (work.momentum[i] + step * work.f_star[i]);
  });
  work.f_star = work.momentum;
  work.velocity_system.add_past_stiffness(parallel, work.v_star, work.f_star);
  timer.visited(static_cast<std::uint64_t>(work.velocity_system.unknowns()), 30 * sizeof(Real));
}

void solve_velocity(const Parallel& parallel, const Scene& scene, Workspace& work, Profile& profile, StepInfo& info) {
  if (scene.solids.empty()) return;
  ScopedTimer timer(profile, Stage::kVelocitySolve);
  const Numerics& numerics = scene.params.numerics;
  const linalg::SolveStats stats = work.velocity_system.solve(parallel, numerics.velocity_solver, work.f_star,
                                                              work.v_star, numerics.velocity_tolerance);
  info.velocity_iterations += static_cast<std::uint64_t>(stats.iterations);
  info.velocity_residual = stats.residual;
  info.unconverged += !stats.converged;
  if (numerics.conserve_momentum) work.velocity_system.conserve_momentum(parallel, work.momentum, work.v_star);
  {
    const system::SolidView view(parallel, work.slip, work.velocity);
    work.velocity_system.scatter(parallel, work.v_star, work.velocity);
  }
  work.slip.follow_solid(parallel, work.velocity);
  timer.visited(static_cast<std::uint64_t>(work.velocity_system.unknowns()), 15 * sizeof(Real));
}

solid::RigidStep transport_frame(const Scene& scene, const Workspace& work, std::size_t l, double dt) {
  if (!scene.params.numerics.conserve_momentum) return {};
  const solid::Momenta &before = work.first_momenta[l], &after = work.solid_momenta[l];
  const unsigned held = work.velocity_system.held_axes(l);
  return held ? solid::held_step(before, after, held, dt) : solid::free_step(before, after, dt);
}

namespace {

constexpr double kSlow = 0.3;  // cells per step: a solid at rest, or sliding, at a wall

}  // namespace

void remember_elements(const Scene& scene, const Workspace& work, std::size_t l, double dt, State& state) {
  const bool slow = work.solids[l].max_speed * dt < kSlow * scene.grid.h;
  if (slow || !work.velocity_system.touches(l))
    solid::remember_elements(work.solids[l], state.solids[l]);
  else
    state.solids[l].stiff.clear();  // in an impact cells fill and empty faster than the choice may lag
}

namespace {

// What flows in through an open face comes from fluid at rest: a jet that took its own speed from beyond the face would
// feed itself.
void still_inflow(const Parallel& parallel, const Scene& scene, grid::VectorField& velocity) {
  const Grid& g = scene.grid;
  const grid::Walls& walls = scene.params.walls;
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

void advect_fluid(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                  Profile& profile) {
  if (!scene.params.fluid.present) return;
  const bool corrected = scene.params.numerics.corrected_fluid_advection;
  still_inflow(parallel, scene, work.velocity);
  work.pressure_system.exchange_scratch(work.advect.storage());
  {
    ScopedTimer timer(profile, Stage::kSmoke);
    const std::uint64_t tiles = fluid::advect_smoke(parallel, work.common.grid, corrected, dt, work.velocity,
                                                    work.cell_fraction, state.fluid, work.advect);
    timer.visited(512 * tiles, 6 * sizeof(Real));
  }
  for (const system::SlipNode& n : work.slip.nodes())  // fluid like any other: corrected
    work.specific_volume[n.node] = static_cast<Real>(1.0 / scene.params.fluid.density);
  ScopedTimer timer(profile, Stage::kFluidAdvection);
  const std::uint64_t tiles =
      fluid::advect_velocity(parallel, work.common.grid, corrected, dt, work.velocity, work.specific_volume,
                             static_cast<Real>(1.0 / scene.params.fluid.density), state.fluid, work.advect);
  timer.visited(512 * tiles, 12 * sizeof(Real));
  work.pressure_system.exchange_scratch(work.advect.storage());
}

void measure_first_momenta(const Parallel& parallel, const State& state, Workspace& work) {
  work.first_momenta.clear();
  for (std::size_t l = 0; l < state.solids.size(); ++l) {
    const solid::SolidState& solid = state.solids[l];
    work.first_momenta.push_back(
        solid::measure_momenta(parallel, solid.band, work.solids[l], solid.band.grid, solid.v));
  }
}

void measure_momentum(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  const Grid& g = work.common.grid;
  work.solid_momenta.clear();
  {
    const system::SolidView view(parallel, work.slip, work.velocity);
    for (std::size_t l = 0; l < scene.solids.size(); ++l)
      work.solid_momenta.push_back(
          solid::measure_momenta(parallel, state.solids[l].band, work.solids[l], g, work.velocity));
  }
  if (scene.solids.empty() || conserved_axes(scene).isZero()) return;
  const FluidSums all = sum_fluid(parallel, g, work.mass, work.velocity);  // work.mass: all matter
  work.fluid_momentum = all.momentum + work.slip.relative_momentum(work.velocity);
  for (const solid::Momenta& solid : work.solid_momenta) work.fluid_momentum -= solid.linear;
}

void restore_momentum(const Parallel& parallel, const Scene& scene, State& state, Workspace& work, Profile& profile) {
  const Grid& g = work.common.grid;
  {
    ScopedTimer timer(profile, Stage::kSolidAdvection);
    for (std::size_t l = 0; l < scene.solids.size(); ++l)
      if (state.solids[l].whole)
        solid::restore_momenta(parallel, work.solid_momenta[l], work.solids[l], state.solids[l]);
  }
  const Vec3d axes = conserved_axes(scene);
  if (scene.solids.empty() || axes.isZero()) return;
  ScopedTimer timer(profile, Stage::kFluidAdvection);
  const FluidSums now = sum_fluid(parallel, g, work.mass, state.fluid.velocity);
  if (!(now.mass > 0.0)) return;
  const Vec3 missing = ((work.fluid_momentum - now.momentum) / now.mass).cwiseProduct(axes).cast<Real>();
  parallel.for_each(static_cast<std::int64_t>(g.node_count()), [&](std::int64_t n) {
    for (std::size_t a = 0; a < 3; ++a)
      state.fluid.velocity.c[a][static_cast<std::size_t>(n)] += missing[static_cast<Eigen::Index>(a)];
  });
}

void measure(const Parallel& parallel, const Scene& scene, State& state, const Workspace& work, StepInfo& info) {
  const Grid& g = scene.grid;
  info.time = state.time;
  info.steps = 1;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidWork& solid = work.solids[l];
    state.solids[l].speed = solid.max_speed;
    info.max_speed_solid = std::max(info.max_speed_solid, solid.max_speed);
    info.min_det_f = l == 0 ? solid.min_det_f : std::min(info.min_det_f, solid.min_det_f);
    info.max_det_f = l == 0 ? solid.max_det_f : std::max(info.max_det_f, solid.max_det_f);
    info.degenerate_cells += solid.degenerate + solid.rejected;
  }
  if (!scene.params.fluid.present) return;
  const std::size_t plane = g.node_stride(2);
  state.fluid_speed = parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t k) {
    Real top = 0;
    for (const auto& c : state.fluid.velocity.c)
      top = std::max(top, largest(plane, c.data() + static_cast<std::size_t>(k) * plane));
    return static_cast<double>(top);
  });
  info.max_speed_fluid = state.fluid_speed;
}

}  // namespace efsi::sim
