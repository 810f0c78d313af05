// Purpose: energies of a solid against closed forms.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "solid/element/energy.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr int kBlockCells = 4;

TestSolid block(material::Law law) {
  return make_block(cube_grid(kBlockCells, kH), material::from_youngs_modulus(law, 2e4, 0.3));
}

// x = F X
void deform(TestSolid& s, const Mat3d& f, double noise = 0.0) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> offset(-noise * kH, noise * kH);
  const Mat3d change = Mat3d::Identity() - f.inverse();
  set_displacement(
      s, [&](const Vec3d& x) -> Vec3d { return change * x + Vec3d(offset(random), offset(random), offset(random)); });
}

// Work of the stress along the straight way from no stretch to this one, per rest volume: Simpson's rule.
double work_of_stress(const material::Elastic& elastic, const Vec3d& stretch) {
  constexpr int kIntervals = 200;
  const Vec3d way = stretch - Vec3d::Ones();
  double sum = 0.0;
  for (int n = 0; n <= kIntervals; ++n) {
    const double weight = n == 0 || n == kIntervals ? 1.0 : n % 2 ? 4.0 : 2.0;
    const Vec3d s = Vec3d::Ones() + way * n / kIntervals;
    sum += weight * material::principal_response(elastic, s).stress.dot(way);
  }
  return sum / (3.0 * kIntervals);
}

}  // namespace

TEST_CASE("The elastic energy of a stretched block is the work of its stress") {
  const Vec3d stretch(1.3, 0.9, 0.8);
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      TestSolid s = block(law);
      deform(s, Eigen::AngleAxisd(0.6, Vec3d(1, 2, 2).normalized()).toRotationMatrix() * stretch.asDiagonal());
      compute(s, points);
      const double rest_volume = std::pow(kBlockCells * kH, 3) / stretch.prod();
      const double exact = rest_volume * work_of_stress(s.rest.elastic, stretch);
      CHECK(solid::elastic_energy(Parallel(2), s.rest, s.state, s.work, points) == Approx(exact).epsilon(1e-4));
      CHECK(solid::measure_shape(Parallel(2), s.rest, s.state, s.work, points).elastic == Approx(exact).epsilon(1e-4));
    }
}

TEST_CASE("The elastic energy is the one that the forces derive from") {
  for (const int points : {1, 8}) {
    TestSolid s = block(material::Law::kCorotational);
    deform(s, Vec3d(1.1, 0.8, 1.2).asDiagonal(), 0.1);
    compute(s, points);
    CHECK(solid::elastic_energy(Parallel(1), s.rest, s.state, s.work, points) ==
          Approx(s.work.elastic_energy).epsilon(1e-9));
  }
}

TEST_CASE("A moving ball: kinetic energy and centre by shape") {
  const Vec3d center(0.5, 0.52, 0.47), velocity(1.0, -2.0, 0.5);
  const double radius = 0.3;
  TestSolid s = make_ball(cube_grid(20, kH), {}, center, radius);
  compute(s, 1);
  for (std::size_t n = 0; n < s.state.v.size(); ++n) s.state.v.set(n, velocity.cast<Real>());
  const solid::ShapeEnergies shape = solid::measure_shape(Parallel(2), s.rest, s.state, s.work, 1);
  const double mass = s.rest.density * 4.0 / 3.0 * M_PI * std::pow(radius, 3);
  CHECK(shape.kinetic == Approx(0.5 * mass * velocity.squaredNorm()).epsilon(5e-3));
  CHECK(shape.elastic == 0.0);
  CHECK((shape.center - center).norm() < 0.02 * kH);
}
