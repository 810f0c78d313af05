#include "transport/momentum_balance.hpp"

#include <algorithm>
#include <limits>

#include "solid/element/mass.hpp"
#include "solid/map/shift_map.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kCentred = 1e-5;  // cells that a restored centre of mass may be off
constexpr int kMostShifts = 3;     // to get there

// 1 along periodic axes of a box from which nothing flows out.
Vec3d conserved_axes(const Scene& scene) {
  const grid::Walls& walls = scene.params.walls;
  Vec3d axes = Vec3d::Zero();
  if (!scene.params.fluid.present || walls.any_open() || !scene.pins.empty()) return axes;
  for (int a = 0; a < 3; ++a) axes[a] = walls.lower(a) == grid::Wall::kPeriodic ? 1.0 : 0.0;
  return axes;
}

struct NodeSums {
  double mass = 0.0;
  Vec3d momentum = Vec3d::Zero();
};
NodeSums sum_nodes(const Parallel& parallel, const Grid& g, const std::vector<Real>& mass,
                   const grid::VectorField& velocity) {
  int end[3];  // the last node of a periodic axis is the first one again
  for (std::size_t a = 0; a < 3; ++a) end[a] = g.cells[a] + (g.periodic[a] ? 0 : 1);
  std::vector<NodeSums> planes(static_cast<std::size_t>(end[2]));
  parallel.for_each(end[2], [&](std::int64_t kk) {
    NodeSums& s = planes[static_cast<std::size_t>(kk)];
    const int k = static_cast<int>(kk);
    for (int j = 0; j < end[1]; ++j)
      for (int i = 0; i < end[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const double m = static_cast<double>(mass[n]);
        s.mass += m;
        s.momentum += m * velocity.at(n).cast<double>();
      }
  });
  NodeSums total;
  for (const NodeSums& s : planes) {
    total.mass += s.mass;
    total.momentum += s.momentum;
  }
  return total;
}

}  // namespace

void measure_first_momenta(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                           TransportMomenta& momenta) {
  momenta.first.clear();
  for (std::size_t l = 0; l < states.size(); ++l)
    momenta.first.push_back(
        solid::measure_momenta(step.parallel, states[l].band, solids[l], states[l].band.grid, states[l].v));
}

void measure_momenta(const StepContext& step, SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     NodeVelocity& velocity, TransportMomenta& momenta) {
  const Grid& g = matter.common.grid;
  momenta.solids.clear();
  for (std::size_t l = 0; l < states.size(); ++l) {
    const system::SolidView view(step.parallel, velocity.slip, l, velocity.field);
    momenta.solids.push_back(solid::measure_momenta(step.parallel, states[l].band, solids[l], g, velocity.field));
    const solid::Momenta &before = momenta.first[l], &after = momenta.solids[l];
    if (after.mass > 0.0) states[l].acceleration = (after.linear - before.linear).norm() / (after.mass * step.dt);
  }
  if (states.empty() || conserved_axes(step.scene).isZero()) return;
  const NodeSums all = sum_nodes(step.parallel, g, matter.mass, velocity.field);
  momenta.fluid = all.momentum + velocity.slip.relative_momentum(velocity.field);
  for (const solid::Momenta& solid : momenta.solids) momenta.fluid -= solid.linear;
}

void find_centers(const StepContext& step, const Holds& holds, const std::vector<solid::BodyStep>& frames,
                  const SolidStates& states, TransportMomenta& momenta) {
  momenta.centers.clear();
  if (momenta.solids.empty()) return;
  const auto pinned = [&](std::size_t l) { return is_pinned(step.scene.pins, l); };
  for (const Cluster& cluster : holds.clusters) {
    if (!cluster.floats() || std::any_of(cluster.solids.begin(), cluster.solids.end(), pinned)) continue;
    momenta.centers.resize(states.size(), Vec3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    for (const std::size_t l : cluster.solids) {
      const solid::Momenta& after = momenta.solids[l];
      if (!states[l].whole || !(after.mass > 0.0)) continue;
      const Vec3d fall = frames[l].shift - step.dt * frames[l].velocity.linear;  // half of what forces add
      momenta.centers[l] = momenta.first[l].center + step.dt * after.linear / after.mass + fall;
    }
  }
}

void restore_centers(const StepContext& step, const TransportMomenta& momenta, SolidStates& states,
                     SolidWorks& solids) {
  ScopedTimer timer(step.profile, Stage::kSolidAdvection);
  for (std::size_t l = 0; l < momenta.centers.size(); ++l) {
    solid::SolidState& state = states[l];
    if (!momenta.centers[l].allFinite()) continue;
    for (int pass = 0; pass < kMostShifts; ++pass) {  // the masses of cells do not quite follow a shift
      const auto now = solid::measure_momenta(step.parallel, state.band, solids[l], state.band.grid, state.v);
      const Vec3d off = momenta.centers[l] - now.center;
      if (off.norm() < kCentred * step.scene.grid.h) break;
      solid::shift_map(step.parallel, off, state);
      solid::compute_mass(step.parallel, step.scene.solids[l], state, solids[l]);
    }
  }
}

void restore_momenta(const StepContext& step, const TransportMomenta& momenta, const SolidWorks& solids,
                     const Matter& matter, SolidStates& states, grid::VectorField& fluid_velocity) {
  {
    ScopedTimer timer(step.profile, Stage::kSolidAdvection);
    for (std::size_t l = 0; l < states.size(); ++l)
      if (states[l].whole && !is_collider(step.scene.pins, l)) {
        solid::Momenta target = momenta.solids[l];
        if (!momenta.friction.empty()) {
          target.linear += momenta.friction[l].linear;
          target.angular += momenta.friction[l].angular;
        }
        solid::restore_momenta(step.parallel, target, solids[l], states[l]);
      }
  }
  const Vec3d axes = conserved_axes(step.scene);
  if (states.empty() || axes.isZero()) return;
  ScopedTimer timer(step.profile, Stage::kFluidAdvection);
  const Grid& g = matter.common.grid;
  const NodeSums now = sum_nodes(step.parallel, g, matter.fluid_mass, fluid_velocity);
  if (!(now.mass > 0.0)) return;
  const Vec3 missing = ((momenta.fluid - now.momentum) / now.mass).cwiseProduct(axes).cast<Real>();
  step.parallel.for_each(static_cast<std::int64_t>(g.node_count()), [&](std::int64_t n) {
    for (std::size_t a = 0; a < 3; ++a)
      fluid_velocity.c[a][static_cast<std::size_t>(n)] += missing[static_cast<Eigen::Index>(a)];
  });
}

}  // namespace efsi::sim
