#include "solid/momentum.hpp"

#include <Eigen/Dense>
#include <Eigen/Geometry>

namespace efsi::solid {
namespace {

constexpr int kMidpointPasses = 6;  // each leaves the angle of a step times the last error

}  // namespace

Mat3d rotation(const Vec3d& turn) { return Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix(); }

void MomentSums::add(double mass, const Vec3d& x, const Vec3d& velocity) {
  mass_ += mass;
  first_ += mass * x;
  second_ += mass * x * x.transpose();
  linear_ += mass * velocity;
  angular_ += mass * x.cross(velocity);
  energy_ += 0.5 * mass * velocity.squaredNorm();
}

void MomentSums::add(const MomentSums& other) {
  mass_ += other.mass_;
  first_ += other.first_;
  second_ += other.second_;
  linear_ += other.linear_;
  angular_ += other.angular_;
  energy_ += other.energy_;
}

Momenta MomentSums::momenta(const Vec3d& origin) const {
  Momenta out;
  out.mass = mass_;
  if (!(mass_ > 0.0)) return out;
  const Vec3d offset = first_ / mass_;
  const Mat3d second = second_ - mass_ * offset * offset.transpose();
  out.center = origin + offset;
  out.linear = linear_;
  out.angular = angular_ - offset.cross(linear_);
  out.inertia = second.trace() * Mat3d::Identity() - second;
  out.kinetic_energy = energy_;
  return out;
}

Momenta joined(std::span<const Momenta> parts) {
  Momenta all;
  for (const Momenta& p : parts) {
    all.mass += p.mass;
    all.center += p.mass * p.center;
    all.linear += p.linear;
    all.kinetic_energy += p.kinetic_energy;
  }
  if (!(all.mass > 0.0)) return all;
  all.center /= all.mass;
  for (const Momenta& p : parts) {
    const Vec3d arm = p.center - all.center;
    all.angular += p.angular + arm.cross(p.linear);
    all.inertia += p.inertia + p.mass * (arm.squaredNorm() * Mat3d::Identity() - arm * arm.transpose());
  }
  return all;
}

RigidMotion rigid_motion(const Momenta& momenta) {
  RigidMotion motion;
  if (!(momenta.mass > 0.0)) return motion;
  const Vec3d linear = momenta.linear / momenta.mass;
  const Vec3d angular = momenta.inertia.ldlt().solve(momenta.angular);
  if (linear.allFinite() && angular.allFinite()) motion = {momenta.center, linear, angular};
  return motion;
}

RigidMotion rigid_motion(const Momenta& momenta, unsigned fixed_axes) {
  if (fixed_axes == 0) return rigid_motion(momenta);
  RigidMotion motion;
  if (!(momenta.mass > 0.0)) return motion;
  motion.center = momenta.center;
  for (int a = 0; a < 3; ++a) {
    if (!(fixed_axes & (1u << a))) motion.linear[a] = momenta.linear[a] / momenta.mass;
    if (fixed_axes == (1u << a) && momenta.inertia(a, a) > 0.0)
      motion.angular[a] = momenta.angular[a] / momenta.inertia(a, a);
  }
  return motion;
}

BodyStep steady_step(const RigidMotion& velocity, double dt) {
  return {velocity, dt * velocity.linear, dt * velocity.angular};
}

BodyStep free_step(const Momenta& before, const Momenta& after, double dt) {
  Momenta mean = after;
  mean.linear = 0.5 * (before.linear + after.linear);
  mean.angular = 0.5 * (before.angular + after.angular);
  BodyStep step = steady_step(rigid_motion(mean), dt);
  step.velocity = rigid_motion(after);
  for (int pass = 0; pass < kMidpointPasses; ++pass) {
    const Mat3d half = rotation(0.5 * step.turn);
    Momenta halfway = mean;
    halfway.inertia = half * mean.inertia * half.transpose();
    step.turn = dt * rigid_motion(halfway).angular;
  }
  return step;
}

BodyStep constrained_step(const Momenta& before, const Momenta& after, unsigned fixed_axes, double dt) {
  BodyStep step;
  step.shift = 0.5 * dt * (rigid_motion(before, fixed_axes).linear - rigid_motion(after, fixed_axes).linear);
  return step;
}

RigidMotion missing_motion(const Momenta& target, const Momenta& now) {
  Momenta missing = now;
  missing.linear = target.linear - now.linear;
  missing.angular = target.angular - now.angular;
  return rigid_motion(missing);
}

Momenta measure_momenta(const Parallel& parallel, const Band& band, const SolidWork& work, const Grid& nodes,
                        const VectorField& velocity) {
  const Grid& g = band.grid;
  const Vec3i lo = grid::offset(g, nodes);
  // Moments about the middle of the band: far from the origin nothing cancels.
  const Vec3d middle = 0.5 * (g.node_position(0, 0, 0) + g.node_position(g.cells[0], g.cells[1], g.cells[2]));
  std::vector<MomentSums> planes(static_cast<std::size_t>(g.cells[2] + 1));
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const double m = static_cast<double>(work.mass[g.node(i, j, k)]);
        if (!(m > 0.0)) continue;
        const Vec3d v = velocity.at(nodes.node(i + lo[0], j + lo[1], k + lo[2])).cast<double>();
        planes[static_cast<std::size_t>(kk)].add(m, g.node_position(i, j, k) - middle, v);
      }
  });
  MomentSums total;
  for (const MomentSums& plane : planes) total.add(plane);
  return total.momenta(middle);
}

void restore_momenta(const Parallel& parallel, const Momenta& target, const SolidWork& work, SolidState& state) {
  const Grid& g = state.band.grid;
  const RigidMotion missing = missing_motion(target, measure_momenta(parallel, state.band, work, g, state.v));
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!state.valid[n]) continue;
        state.v.set(n, state.v.at(n) + Vec3(missing.at(g.node_position(i, j, k)).cast<Real>()));
      }
  });
}

}  // namespace efsi::solid
