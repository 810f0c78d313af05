#include "nodes/node_velocity.hpp"

#include <array>

#include "frame/grid_loops.hpp"
#include "linalg/reduce.hpp"
#include "nodes/step_weight.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Of the fluid and of the solids before l at a node that l shares with others.
Real mass_before(const SolidStates& states, const SolidWorks& solids, const Matter& matter, std::size_t l,
                 std::array<int, 3> at) {
  const Grid& g = matter.common.grid;
  Real mass = matter.fluid_mass[g.node(at[0], at[1], at[2])];
  for (std::size_t other = 0; other < l; ++other) {
    const Grid& band = states[other].band.grid;
    const Vec3i lo = grid::offset(band, g);
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) inside = inside && at[a] >= lo[a] && at[a] <= lo[a] + band.cells[a];
    if (!inside) continue;
    const Real m = solids[other].mass[band.node(at[0] - lo[0], at[1] - lo[1], at[2] - lo[2])];
    if (m > 0) mass += m;
  }
  return mass;
}

// Solid l joins what is at the nodes of its band.
void mix_in(const Parallel& parallel, const SolidStates& states, const SolidWorks& solids, std::size_t l,
            const Vec3& velocity_change, const Matter& matter, grid::VectorField& velocity) {
  const Grid& g = matter.common.grid;
  const Real* kick = velocity_change.data();
  const grid::VectorField& own = states[l].v;
  for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
    const Real m = solids[l].mass[local];
    if (!(m > 0)) return;
    const std::size_t n = g.node(i, j, k);
    Real before = matter.fluid_mass[n];
    if (before + m != matter.mass[n]) before = mass_before(states, solids, matter, l, {i, j, k});
    const Real total = before + m;
    for (std::size_t a = 0; a < 3; ++a)
      velocity.c[a][n] = (before * velocity.c[a][n] + m * (own.c[a][local] + kick[a])) / total;
  });
}

// With this weight.
void combine(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
             const StepWeight& weight, grid::VectorField& fluid_velocity, NodeVelocity& velocity) {
  const Grid& g = matter.common.grid;
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  if (step.scene.params.fluid.present)
    std::swap(velocity.field.c, fluid_velocity.c);  // the advection gives it back
  else
    for (auto& component : velocity.field.c) linalg::fill(step.parallel, component, g.node_count(), Real(0));
  if (!weight.fluid.isZero(0))
    for (std::size_t a = 0; a < 3; ++a) {
      Real* v = velocity.field.c[a].data();
      const Real kick = weight.fluid[static_cast<Eigen::Index>(a)];
      step.parallel.for_each(static_cast<std::int64_t>(g.node_count()), [=](std::int64_t n) { v[n] += kick; });
    }
  std::vector<Vec3> slipping;  // the fluid's velocity at slip nodes, where nothing is mixed
  for (const system::SlipNode& n : velocity.slip.nodes()) slipping.push_back(velocity.field.at(n.node));
  for (std::size_t l = 0; l < states.size(); ++l)
    mix_in(step.parallel, states, solids, l, weight.solids[l], matter, velocity.field);
  for (std::size_t t = 0; t < slipping.size(); ++t) {
    const system::SlipNode& n = velocity.slip.nodes()[t];
    const solid::SolidState& solid = states[n.solid];
    const Vec3i lo = grid::offset(solid.band.grid, g);
    velocity.slip.solid_velocity()[t] =
        weight.solids[n.solid] + solid.v.at(solid.band.grid.node(n.i - lo[0], n.j - lo[1], n.k - lo[2]));
    velocity.field.set(n.node, slipping[t]);
  }
}

}  // namespace

void combine_velocities(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const Matter& matter, grid::VectorField& fluid_velocity, NodeVelocity& velocity) {
  combine(step, states, solids, matter, weight_in_step(step.scene, step.dt, solids), fluid_velocity, velocity);
}

void copy_velocities(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     const grid::VectorField& fluid_velocity, const system::SlipNodes& slip, NodeVelocity& copy) {
  copy.slip = slip;
  grid::VectorField fluid = fluid_velocity;
  combine(step, states, solids, matter, {Vec3::Zero(), std::vector<Vec3>(states.size(), Vec3::Zero())}, fluid, copy);
}

}  // namespace efsi::sim
