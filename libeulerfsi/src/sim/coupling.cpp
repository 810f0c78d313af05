#include "sim/coupling.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/kernel.hpp"
#include "fluid/advect.hpp"
#include "fluid/forces.hpp"
#include "grid/boundary.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {
namespace {

using grid::Grid;

// Calls body(band cell or node index, i, j, k of the global grid) for a solid's band, planes in parallel.
template <class Body>
void for_band_nodes(const Parallel& parallel, const solid::Band& band, const Body& body) {
  const Grid& g = band.grid;
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) body(g.node(i, j, k), i + band.lo[0], j + band.lo[1], k + band.lo[2]);
  });
}

template <class Body>
void for_band_cells(const Parallel& parallel, const solid::Band& band, const Body& body) {
  const Grid& g = band.grid;
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) body(g.cell(i, j, k), i + band.lo[0], j + band.lo[1], k + band.lo[2]);
  });
}

// Gives a field n values.
void fill(const Parallel& parallel, std::vector<Real>& field, std::size_t n, Real value) {
  field.resize(n);
  parallel.for_ranges(static_cast<std::int64_t>(n), [&](std::int64_t begin, std::int64_t end) {
    std::fill(&field[0] + begin, &field[0] + end, value);
  });
}

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

// Calls body(padded cell) for the cells that a solid owns.
template <class Body>
void for_owned_cells(const Parallel& parallel, const Scene& scene, const State& state, const Workspace& work,
                     std::size_t l, const Body& body) {
  for_band_cells(parallel, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
    if (work.solids[l].element[c] >= 0) body(scene.grid.padded(i, j, k));
  });
}

void find_owned_cells(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  work.owned.assign(scene.solids.empty() ? 0 : scene.grid.padded_count(), 0);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_owned_cells(parallel, scene, state, work, l, [&](std::size_t c) { work.owned[c] = 1; });
}

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
    if (active.empty()) active.assign(scene.grid.padded_count(), 1);
    for_owned_cells(parallel, scene, state, work, l, [&](std::size_t c) { active[c] = 0; });
  }
  return active;
}

constexpr double kSlow = 0.3;            // cells per step: a solid at rest, or sliding, at a wall
constexpr double kLargestGrowth = 0.02;  // of a solid's volume in a step, to make up for what its surface has lost

// b of Eq. 11: where det F has drifted from 1 the solid is asked to grow or shrink back, slowly, since det F is rough
// at the surface. What a solid that touches a wall has lost as a whole its inside gains in the same step. What solids
// gain the fluid of the box loses, so that the sum vanishes.
void compute_volume_source(const Parallel& parallel, const Scene& scene, const State& state, double dt,
                           Workspace& work) {
  const Grid& g = scene.grid;
  work.source.assign(g.padded_count(), 0);
  const double tau = std::max(4.0 * dt, 1.0 / 24.0), limit = 0.1 / dt;
  double total = 0.0, fluid_cells = static_cast<double>(g.cell_count());
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidWork& solid = work.solids[l];
    fluid_cells -= static_cast<double>(solid.element_cell.size());
    if (scene.solids[l].compressible) continue;
    const bool lossy = work.velocity_system.touches(l) && state.solids[l].whole && solid::encloses(scene.solids[l]);
    const double lost = lossy ? 1.0 - solid::volume_ratio(scene.solids[l], state.solids[l]) : 0.0;
    const double growth = std::clamp(lost, -kLargestGrowth, kLargestGrowth) / dt;
    for_band_cells(parallel, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
      if (solid.element[c] < 0) return;
      const double det = static_cast<double>(solid.volume_ratio[c]);
      const double rate = growth + std::clamp((1.0 - det) / (det * tau), -limit, limit);
      work.source[g.padded(i, j, k)] = static_cast<Real>(rate * static_cast<double>(solid.fraction[c]));
    });
  }
  if (!scene.params.fluid.present || scene.params.walls.any_open() || fluid_cells < 1.0) return;
  total = parallel.sum(g.cells[2], [&](std::int64_t k) {
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

// Calls body(node, i, j, k) for the nodes on the faces of the box.
template <class Body>
void for_face_nodes(const Parallel& parallel, const Grid& g, const Body& body) {
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j) {
      const bool face = k == 0 || j == 0 || k == g.cells[2] || j == g.cells[1];
      for (int i = 0; i <= g.cells[0]; i += face ? 1 : g.cells[0]) body(g.node(i, j, k), i, j, k);
    }
  });
}

// Which components walls fix: by the faces, less where a solid slides.
void find_fixed_components(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  const Grid& g = scene.grid;
  work.fixed.resize(g.node_count(), 0);
  for_face_nodes(parallel, g, [&](std::size_t n, int i, int j, int k) {
    work.fixed[n] = static_cast<std::uint8_t>(grid::fixed_components(g, scene.params.walls, i, j, k));
  });
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::Band& band = state.solids[l].band;
    for_face_nodes(parallel, band.grid, [&](std::size_t local, int i, int j, int k) {
      const int gi = i + band.lo[0], gj = j + band.lo[1], gk = k + band.lo[2];
      const std::size_t n = g.node(gi, gj, gk);
      if (work.fixed[n] && work.solids[l].carries[local])
        work.fixed[n] = grid::fixed_for_solid(g, scene.params.walls, gi, gj, gk);
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
  const Grid& g = scene.grid;
  const bool solids = !scene.solids.empty();
  if (!solids && work.uniform_ready) return;
  find_fixed_components(parallel, scene, state, work);
  const double h3 = g.h * g.h * g.h;
  const Real fluid_density = scene.params.fluid.present ? static_cast<Real>(scene.params.fluid.density) : Real(0);

  // The fluid fills what the solids leave free.
  if (solids) {
    fill(parallel, work.cell_fraction, g.cell_count(), Real(0));
    for (std::size_t l = 0; l < scene.solids.size(); ++l)
      for_band_cells(parallel, state.solids[l].band, [&](std::size_t c, int i, int j, int k) {
        Real& fraction = work.cell_fraction[g.cell(i, j, k)];
        fraction = std::min(Real(1), fraction + work.solids[l].fraction[c]);
      });
  }
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
  if (solids) {
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
      for_band_nodes(parallel, state.solids[l].band, [&](std::size_t, int i, int j, int k) {
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
}

// The nodes at the surfaces of solids along which the fluid slips: not at walls, nor where solids meet, nor at gaps of
// less than a cell, whose corners all belong to solids. Before the masses of solids are added to work.mass.
void find_slip_nodes(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  work.slip = {};
  if (!scene.params.numerics.fluid_slips || !scene.params.fluid.present || scene.solids.empty()) return;
  const Grid& g = scene.grid;
  std::vector<std::uint8_t> carriers(g.node_count(), 0);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, state.solids[l].band, [&](std::size_t local, int i, int j, int k) {
      if (work.solids[l].carries[local]) ++carriers[g.node(i, j, k)];
    });
  const auto is_gap = [&](int i, int j, int k) {
    return std::all_of(std::begin(grid::kCorner), std::end(grid::kCorner),
                       [&](const auto& c) { return carriers[g.node(i + c[0], j + c[1], k + c[2])] > 0; });
  };
  std::vector<std::vector<system::SlipNode>> planes(static_cast<std::size_t>(g.cells[2] + 1));
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, state.solids[l].band, [&](std::size_t local, int i, int j, int k) {
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
  work.slip = system::SlipNodes(g, std::move(nodes));
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

}  // namespace

void compute_masses(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work,
                    Profile& profile) {
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    ScopedTimer timer(profile, Stage::kSolidMass);
    solid::compute_mass(parallel, scene.solids[l], state.solids[l], work.solids[l]);
    timer.visited(work.solids[l].mass.size(), 5 * sizeof(Real));
  }
  ScopedTimer timer(profile, Stage::kFluidForces);
  combine_masses(parallel, scene, state, work, timer);
  find_owned_cells(parallel, scene, state, work);
  find_slip_nodes(parallel, scene, state, work);
  work.masses_ready = true;
}

namespace {

constexpr double kMostLift = 1.0;

// What gravity changes in the velocities of the fluid and of each solid in a step [m/s].
struct Weight {
  Vec3 fluid;
  std::vector<Vec3> solids;
};

// Weight less the buoyancy in an ambient density, whose hydrostatic pressure the pressure leaves out: the fluid's. So a
// solid floats by what it weighs and not by how the stairs of its cells sum up the pressure, and what has the fluid's
// density stays at rest. A light solid is not pushed up with more than kMostLift times its weight, which the elastic
// solve would follow before the pressure answers; the rest of its buoyancy is the pressure's.
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

}  // namespace

void combine_velocities(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work) {
  const Grid& g = scene.grid;
  const Weight weight = weight_in_step(scene, dt, work);
  if (scene.params.fluid.present)
    std::swap(work.velocity.c, state.fluid.velocity.c);  // the advection gives it back
  else
    for (auto& component : work.velocity.c) fill(parallel, component, g.node_count(), Real(0));
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
    for_band_nodes(parallel, solid.band, [&](std::size_t local, int i, int j, int k) {
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
    const Vec3i& lo = solid.band.lo;
    work.slip.solid_velocity()[t] =
        weight.solids[n.solid] + solid.v.at(solid.band.grid.node(n.i - lo[0], n.j - lo[1], n.k - lo[2]));
    work.velocity.set(n.node, fluid_velocity[t]);
  }
  if (scene.solids.empty() && work.uniform_ready) return;
  const double h3 = g.h * g.h * g.h;
  const Real fluid_volume = scene.params.fluid.present ? static_cast<Real>(1.0 / scene.params.fluid.density) : Real(0);
  fill(parallel, work.specific_volume, g.node_count(), fluid_volume);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, state.solids[l].band, [&](std::size_t, int i, int j, int k) {
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
  const Grid& g = scene.grid;
  if (scene.params.fluid.present)
    fluid::apply_emitters(parallel, g, scene.emitters, state.time, state.fluid, work.velocity);
  const std::uint64_t visited = fluid::add_body_forces(parallel, g, scene.params.fluid, state.fluid,
                                                       scene.params.gravity, dt, work.specific_volume, work.velocity);
  timer.visited(visited, 4 * sizeof(Real));
  work.slip.share_normal(parallel, work.velocity);
  enforce_walls(parallel, g, work.fixed, work.velocity);
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
  work.velocity_system.assemble(parallel, scene.grid, work.fixed, refs, work.mass, work.slip, dt);
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

namespace {

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
    work.pressure_system.assemble(parallel, scene.grid, scene.params.walls, work.fixed, work.specific_volume,
                                  std::move(active), work.owned, &work.slip);
    work.uniform_ready = scene.solids.empty();
  }
  work.source.clear();
  if (scene.params.numerics.volume_source && !scene.solids.empty())
    compute_volume_source(parallel, scene, state, dt, work);
}

// J^T q on the unknowns, where walls leave them free. Fills the ghosts of q.
void compute_impulses(const Parallel& parallel, const Scene& scene, const Workspace& work, std::vector<Real>& q,
                      std::vector<Real>& impulse) {
  const auto& system = work.velocity_system;
  grid::fill_ghosts(scene.grid, q, Real(0));
  const std::vector<Vec3> slides = work.slip.sliding_impulse(parallel, q);
  const auto& nodes = system.nodes();
  const auto row = static_cast<std::size_t>(scene.grid.cells[0] + 1);
  const auto plane = row * static_cast<std::size_t>(scene.grid.cells[1] + 1);
  impulse.resize(3 * nodes.size());
  parallel.for_each(system.unknowns(), [&](std::int64_t u) {
    const std::size_t n = nodes[static_cast<std::size_t>(u)];
    const Vec3 g = system::pressure_impulse(scene.grid, q, static_cast<int>(n % row), static_cast<int>(n % plane / row),
                                            static_cast<int>(n / plane));
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

}  // namespace

void prepare_pressure(const Parallel& parallel, const Scene& scene, double dt, const State& state, Workspace& work,
                      Profile& profile) {
  work.taken.clear();
  if (!has_pressure(scene)) return;
  ScopedTimer timer(profile, Stage::kPressureSolve);
  assemble_pressure_system(parallel, scene, dt, state, work);
  const std::vector<Real>& p = state.fluid.pressure;
  if (!scene.params.numerics.coupling_step || scene.solids.empty() || p.empty()) return;
  // Within the solids, over the fluid's level; the fluid's own pressure would feed what it moves.
  const Grid& g = scene.grid;
  double level = 0.0;
  std::size_t fluid_cells = 0;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.padded(i, j, k);
        if (work.owned[c]) continue;
        level += static_cast<double>(p[c]);
        ++fluid_cells;
      }
  if (fluid_cells > 0) level /= static_cast<double>(fluid_cells);
  std::vector<Real> q(p.size(), 0);
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    if (scene.solids[l].compressible) continue;
    for_owned_cells(parallel, scene, state, work, l,
                    [&](std::size_t c) { q[c] = static_cast<Real>(-dt * (static_cast<double>(p[c]) - level)); });
  }
  std::vector<Real>& impulse = work.correction;
  compute_impulses(parallel, scene, work, q, impulse);
  double with = 0.0, without = 0.0;
  for (std::size_t i = 0; i < impulse.size(); ++i) {
    const double f = static_cast<double>(work.velocity_system.free()[i]) * static_cast<double>(work.f_star[i]);
    without += f * f;
    with += (f - static_cast<double>(impulse[i])) * (f - static_cast<double>(impulse[i]));
  }
  if (!(with < kLastHolds * kLastHolds * without)) return;
  for (std::size_t i = 0; i < impulse.size(); ++i) {
    work.f_star[i] -= impulse[i];
    work.momentum[i] -= impulse[i];
  }
  std::fill(work.v_star.begin(), work.v_star.end(), Real(0));  // the start of the solve: nearly at rest
  work.pressure_system.project(parallel, q, work.velocity);
  work.taken = std::move(q);
}

void solve_velocity(const Parallel& parallel, const Scene& scene, double, Workspace& work, Profile& profile,
                    StepInfo& info) {
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

namespace {

// Eq. 13: work.correction = G^-1 J^T q on the nodes that carry solids.
void solve_correction(const Parallel& parallel, const Scene& scene, std::vector<Real>& q, Workspace& work,
                      Profile& profile, StepInfo& info) {
  ScopedTimer timer(profile, Stage::kVelocitySolve);
  const Numerics& numerics = scene.params.numerics;
  auto& system = work.velocity_system;
  std::vector<Real>& impulse = work.f_star;
  compute_impulses(parallel, scene, work, q, impulse);
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
    const linalg::SolveStats stats = work.pressure_system.estimate(parallel, work.velocity, work.source, kEstimate, q);
    info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
    for (std::size_t l = 0; l < scene.solids.size(); ++l) {
      const solid::SolidRest& solid = scene.solids[l];
      if (solid.compressible) continue;
      const double modulus = work.solids[l].element_weight * (2.0 * solid.elastic.mu + solid.elastic.lambda);
      const Real share =
          static_cast<Real>(static_cast<double>(work.velocity_system.stiffness_factor(l)) * modulus / volume);
      for_owned_cells(parallel, scene, state, work, l,
                      [&](std::size_t c) { q[c] += share * work.pressure_system.residual()[c]; });
    }
  }
  solve_correction(parallel, scene, q, work, profile, info);
  correct_velocity(parallel, q, 1, work, profile);
  const Real length = static_cast<Real>(work.pressure_system.step_length(parallel, work.velocity, work.source, q));
  work.taken.resize(q.size(), 0);
  for (std::size_t c = 0; c < q.size(); ++c) {
    work.taken[c] += length * q[c];
    q[c] *= length - 1;
  }
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
    before = work.pressure_system.norms(parallel, work.velocity, work.source);
    info.divergence_before = before.all;
    info.divergence_before_solid = before.solid;
  }
  // A body at rest that the step now serves and now does not would never come to rest.
  if (!work.taken.empty() || needs_coupling(scene, before))
    couple_pressure(parallel, scene, state, work, profile, info);
  ScopedTimer timer(profile, Stage::kPressureSolve);
  // Holds the pressure between steps and the multiplier of J during one: J^T is minus the gradient, so q = -dt p. The
  // coupling step's part is added after the projection.
  std::vector<Real>& q = state.fluid.pressure;
  q.resize(scene.grid.padded_count(), 0);
  const Real step = static_cast<Real>(-dt);
  for (Real& value : q) value *= step;
  for (std::size_t c = 0; c < work.taken.size(); ++c) q[c] -= work.taken[c];
  const linalg::SolveStats stats = work.pressure_system.solve(parallel, numerics.pressure_solver, work.velocity,
                                                              work.source, numerics.pressure_tolerance, q, &before);
  info.pressure_iterations += static_cast<std::uint64_t>(stats.iterations);
  info.pressure_residual = stats.residual;
  info.unconverged += !stats.converged;
  timer.visited(scene.grid.cell_count(), 12 * sizeof(Real));
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
  for (std::size_t c = 0; c < work.taken.size(); ++c) q[c] += work.taken[c];
  const Real inverse_step = static_cast<Real>(-1.0 / dt);
  for (Real& value : q) value *= inverse_step;
  const system::DivergenceNorms after = work.pressure_system.norms(parallel, work.velocity, work.source);
  info.divergence_after = after.all;
  info.divergence_after_solid = after.solid;
}

solid::RigidMotion transport_frame(const Scene& scene, const Workspace& work, std::size_t l) {
  const bool moving = scene.params.numerics.conserve_momentum && !work.velocity_system.touches(l);
  return moving ? solid::rigid_motion(work.solid_momenta[l]) : solid::RigidMotion{};
}

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
  {
    ScopedTimer timer(profile, Stage::kFluidAdvection);
    fluid::set_flow(parallel, scene.grid, work.velocity, work.advect);
  }
  {
    ScopedTimer timer(profile, Stage::kSmoke);
    const std::uint64_t tiles =
        fluid::advect_smoke(parallel, scene.grid, corrected, dt, work.cell_fraction, state.fluid, work.advect);
    timer.visited(512 * tiles, 6 * sizeof(Real));
  }
  for (const system::SlipNode& n : work.slip.nodes())  // fluid like any other: corrected
    work.specific_volume[n.node] = static_cast<Real>(1.0 / scene.params.fluid.density);
  ScopedTimer timer(profile, Stage::kFluidAdvection);
  const std::uint64_t tiles =
      fluid::advect_velocity(parallel, scene.grid, corrected, dt, work.specific_volume,
                             static_cast<Real>(1.0 / scene.params.fluid.density), state.fluid, work.advect);
  timer.visited(512 * tiles, 12 * sizeof(Real));
}

void measure_momentum(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work) {
  const Grid& g = scene.grid;
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
  const Grid& g = scene.grid;
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
  state.solid_speed = 0.0;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidWork& solid = work.solids[l];
    state.solid_speed = std::max(state.solid_speed, solid.max_speed);
    info.min_det_f = l == 0 ? solid.min_det_f : std::min(info.min_det_f, solid.min_det_f);
    info.max_det_f = l == 0 ? solid.max_det_f : std::max(info.max_det_f, solid.max_det_f);
    info.degenerate_cells += solid.degenerate + solid.rejected;
  }
  info.max_speed_solid = state.solid_speed;
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
