#include "sources/apply_forces.hpp"

#include <algorithm>

namespace efsi::sim {

using grid::Grid;

namespace {

// Time in the step in which it acts [s].
double time_on(const ForceField& force, double time, double dt) {
  return std::max(0.0, std::min(force.end_time, time + dt) - std::max(force.start_time, time));
}

void push_solid(const Parallel& parallel, const ForceField& force, double time, double duration, solid::SolidWork& work,
                solid::SolidState& state) {
  const Grid& g = state.band.grid;
  if (work.force_velocity.size() == 0) work.force_velocity.assign(g.node_count());
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const Vec3d x = g.node_position(i, j, k);
        if (!(work.mass[n] > 0) || !force.contains(x)) continue;
        const Vec3d v = state.v.at(n).cast<double>(), change = force.velocity_change(x, v, time, duration);
        state.v.set(n, (v + change).cast<Real>());
        work.force_velocity.set(n, work.force_velocity.at(n) + change.cast<Real>());
      }
  });
}

void push_fluid(const Parallel& parallel, const ForceField& force, double time, double duration, const Grid& g,
                grid::VectorField& velocity) {
  const auto place = [&](int i, std::size_t axis) { return g.periodic[axis] && i == g.cells[axis] ? 0 : i; };
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d x = g.node_position(place(i, 0), place(j, 1), place(k, 2));
        if (!force.contains(x)) continue;
        const std::size_t n = g.node(i, j, k);
        const Vec3d v = velocity.at(n).cast<double>();
        velocity.set(n, (v + force.velocity_change(x, v, time, duration)).cast<Real>());
      }
  });
}

}  // namespace

std::uint64_t apply_forces(const StepContext& step, const Grid& common, SolidWorks& solids, SolidStates& states,
                           grid::VectorField& fluid_velocity) {
  std::uint64_t nodes = 0;
  for (solid::SolidWork& work : solids) work.force_velocity.assign(0);
  for (const ForceField& force : step.scene.forces) {
    const double duration = time_on(force, step.time, step.dt);
    if (!(duration > 0.0)) continue;
    if (force.acts_on != ForceField::ActsOn::kFluid)
      for (std::size_t l = 0; l < states.size(); ++l) {
        push_solid(step.parallel, force, step.time, duration, solids[l], states[l]);
        nodes += states[l].band.grid.node_count();
      }
    if (force.acts_on != ForceField::ActsOn::kSolids && step.scene.params.fluid.present) {
      push_fluid(step.parallel, force, step.time, duration, common, fluid_velocity);
      nodes += common.node_count();
    }
  }
  return nodes;
}

}  // namespace efsi::sim
