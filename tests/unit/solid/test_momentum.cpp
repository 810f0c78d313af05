// Purpose: linear and angular momentum of a solid, and their restoration.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "solid/momentum.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const Vec3d kCenter(0.183, 0.176, 0.181);

TestSolid make_moving_ball(const std::function<Vec3d(const Vec3d&)>& velocity) {
  const material::Elastic soft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);
  TestSolid s = make_ball(cube_grid(18, 0.02), soft, kCenter, 0.1);
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        s.state.v.set(g.node(i, j, k), Vec3(velocity(g.node_position(i, j, k)).cast<Real>()));
  return s;
}

solid::Momenta measure(const TestSolid& s, int threads = 1) {
  return solid::measure_momenta(Parallel(threads), s.state.band, s.work, s.state.band.grid, s.state.v);
}

double distance(const Vec3d& a, const Vec3d& b) { return (a - b).norm(); }

}  // namespace

TEST_CASE("The momenta of a ball that flies and turns are those of a rigid ball", "[law]") {
  const Vec3d v(1.0, -2.0, 0.5), spin(3.0, 1.0, -2.0);
  const TestSolid s = make_moving_ball([&](const Vec3d& x) -> Vec3d { return v + spin.cross(x - kCenter); });
  const solid::Momenta m = measure(s);
  CHECK(m.mass == Approx(s.work.total_mass).epsilon(1e-5));
  CHECK(distance(m.center, kCenter) < 2e-4);
  CHECK(distance(m.linear, m.mass * v) < 2e-3 * m.linear.norm());
  const double inertia = 0.4 * m.mass * 0.1 * 0.1;  // lumping spreads the mass by a part of the cell
  CHECK(distance(m.angular, inertia * spin) < 0.07 * m.angular.norm());
  CHECK(distance(m.inertia * spin, m.angular) < 1e-5 * m.angular.norm());
  CHECK(m.kinetic_energy == Approx(0.5 * m.mass * v.squaredNorm() + 0.5 * spin.dot(m.inertia * spin)).epsilon(3e-3));
}

TEST_CASE("Restored momenta are those of the target, by a rigid motion, for every number of threads", "[law]") {
  const auto bent = [](const Vec3d& x) {
    return Vec3d(std::sin(20 * x[1]), 30 * x[0] * x[2], 0.3 - std::cos(15 * x[0]));
  };
  solid::Momenta target = measure(make_moving_ball(bent));
  target.linear += Vec3d(0.1, -0.2, 0.05);
  target.angular += Vec3d(-1e-3, 2e-3, 1.5e-3);
  TestSolid one = make_moving_ball(bent), three = make_moving_ball(bent);
  const TestSolid before = make_moving_ball(bent);
  solid::restore_momenta(Parallel(1), target, one.work, one.state);
  solid::restore_momenta(Parallel(3), target, three.work, three.state);
  const solid::Momenta now = measure(one);
  CHECK(distance(now.linear, target.linear) < 1e-6 * target.linear.norm());
  CHECK(distance(now.angular, target.angular) < 1e-5 * target.angular.norm());
  bool same = true;
  Mat3d strain = Mat3d::Zero();
  const grid::Grid& g = one.state.band.grid;
  for (std::size_t n = 0; n < g.node_count(); ++n) same = same && one.state.v.at(n) == three.state.v.at(n);
  CHECK(same);
  for (int a = 0; a < 3; ++a) {  // what was added has no strain
    const std::size_t n = g.node(7, 8, 9), next = n + g.node_stride(static_cast<std::size_t>(a));
    const Vec3 added = (one.state.v.at(next) - before.state.v.at(next)) - (one.state.v.at(n) - before.state.v.at(n));
    strain.col(a) = added.cast<double>() / g.h;
  }
  CHECK(strain.norm() > 0.1);
  CHECK((strain + strain.transpose()).norm() < 1e-3 * strain.norm());
}

TEST_CASE("A body that walls hold moves along them and turns about the normal of the only one") {
  solid::Momenta m;
  m.mass = 2.0;
  m.linear = {1, 2, 3};
  m.angular = {4, 5, 6};
  m.inertia = Vec3d(1, 2, 3).asDiagonal();
  CHECK(solid::rigid_motion(m, 0).linear == Vec3d(0.5, 1, 1.5));
  CHECK(solid::rigid_motion(m, 0).angular.isApprox(Vec3d(4, 2.5, 2)));
  const solid::RigidMotion floor = solid::rigid_motion(m, 2), edge = solid::rigid_motion(m, 3);
  CHECK(floor.linear == Vec3d(0.5, 0, 1.5));
  CHECK(floor.angular == Vec3d(0, 2.5, 0));
  CHECK(edge.linear == Vec3d(0, 0, 1.5));
  CHECK(edge.angular == Vec3d(0, 0, 0));
  CHECK(solid::rigid_motion(m, 7).linear == Vec3d(0, 0, 0));
}

TEST_CASE("A free body moves by the mean of two velocities and ends with the second", "[law]") {
  solid::Momenta before;
  before.mass = 2.0;
  before.center = {0.1, 0.2, 0.3};
  before.inertia = 0.5 * Mat3d::Identity();
  solid::Momenta after = before;
  before.linear = {1, 0, -2};
  after.linear = {3, 1, -2};
  before.angular = {0, 0, 1};
  after.angular = {0, 0, 2};
  const solid::BodyStep step = solid::free_step(before, after, 0.1);
  CHECK(step.shift.isApprox(Vec3d(0.1, 0.025, -0.1)));
  CHECK(step.turn.isApprox(Vec3d(0, 0, 0.3)));
  CHECK(step.velocity.center == before.center);
  CHECK(step.velocity.linear.isApprox(Vec3d(1.5, 0.5, -1)));
  CHECK(step.velocity.angular.isApprox(Vec3d(0, 0, 4)));
  // On a floor, where the last velocity is that of the field: what the mean moves it less along the floor.
  CHECK(solid::constrained_step(before, after, 2, 0.1).shift.isApprox(Vec3d(-0.05, 0, 0)));
  CHECK(solid::constrained_step(before, after, 2, 0.1).velocity.linear.isZero(0));
  CHECK(solid::constrained_step(before, after, 7, 0.1).shift.isZero(0));
}

TEST_CASE("A free rigid body keeps its energy in long steps, and turns to second order", "[law]") {
  const Vec3d moments(1.0, 2.0, 2.6), momentum(0.5, 2.0, 0.7);
  Mat3d end[3];
  for (int level = 0; level < 3; ++level) {
    const double dt = 0.2 / (1 << level), duration = 40.0;  // ten turns and more
    Mat3d r = Mat3d::Identity();
    solid::Momenta m;
    m.mass = 1.0;
    m.angular = momentum;
    double low = 1.0, high = 1.0;
    const double first = momentum.dot(momentum.cwiseQuotient(moments));
    for (int n = 0; n < std::lround(duration / dt); ++n) {
      m.inertia = r * moments.asDiagonal() * r.transpose();
      const double energy = momentum.dot(solid::rigid_motion(m).angular) / first;
      low = std::min(low, energy);
      high = std::max(high, energy);
      r = solid::rotation(solid::free_step(m, m, dt).turn) * r;
    }
    end[level] = r;
    INFO("steps of " << dt << ": energy " << low << " to " << high);
    CHECK(high - low < 0.04 / (1 << 2 * level));
  }
  const double coarse = (end[0] - end[1]).norm(), fine = (end[1] - end[2]).norm();
  INFO("orientations differ by " << coarse << ", " << fine);
  CHECK(fine < coarse / 3.0);
}

TEST_CASE("A body without mass is left as it is") {
  TestSolid s = make_moving_ball([](const Vec3d& x) { return x; });
  std::fill(s.work.mass.begin(), s.work.mass.end(), Real(0));
  solid::Momenta target;
  target.linear = Vec3d(1, 1, 1);
  solid::restore_momenta(Parallel(1), target, s.work, s.state);
  CHECK(s.state.v.at(5) == s.state.band.grid.node_position(5, 0, 0).cast<Real>());
  const solid::BodyStep step = solid::free_step({}, {}, 0.1);
  CHECK(step.shift.isZero(0));
  CHECK(step.turn.isZero(0));
}
