// Purpose: Eq. 14 and Eq. 15 against cases worked out by hand.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "contact/repulsion.hpp"

using namespace efsi;

namespace {

constexpr double kDt = 0.01, kMass = 2.0;
const Vec3d kUp(0, 1, 0);

}  // namespace

TEST_CASE("Eq. 14: a particle is pushed by the spring or to the speed at which a tenth of the overlap goes in a step") {
  // d = 0.5 m, 0.1 d / dt = 5 m/s; it comes at 3 m/s: 8 m/s times 2 kg are 16 N s.
  const Vec3d in(0, -3, 0);
  CHECK(solid::repel(in, kUp, 0.5, kMass, 1e6, 0.0, kDt).normal_impulse == Approx(16.0));
  // k = 1000 N/m gives dt k d = 5 N s only.
  CHECK(solid::repel(in, kUp, 0.5, kMass, 1000.0, 0.0, kDt).normal_impulse == Approx(5.0));
  // At 5 m/s outwards and more, without overlap and without stiffness there is nothing.
  CHECK(solid::repel({0, 4, 0}, kUp, 0.5, kMass, 1e6, 0.0, kDt).normal_impulse == Approx(2.0));
  CHECK(solid::repel({0, 5.01, 0}, kUp, 0.5, kMass, 1e6, 0.0, kDt).normal_impulse == 0.0);
  CHECK(solid::repel(in, kUp, 0.0, kMass, 1e6, 0.5, kDt).normal_impulse == 0.0);
  CHECK(solid::repel(in, kUp, -0.1, kMass, 1e6, 0.5, kDt).normal_impulse == 0.0);
  CHECK(solid::repel(in, kUp, 0.5, kMass, 0.0, 0.5, kDt).normal_impulse == 0.0);
}

TEST_CASE("Eq. 15: friction takes mu Delta v_N of what slides, and never turns it round") {
  // Delta v_N = 8 m/s. Of 10 m/s along x and 0 along z: mu = 0.5 leaves 1 - 4/10.
  const Vec3d v(10, -3, 0);
  const auto slides = solid::repel(v, kUp, 0.5, kMass, 1e6, 0.5, kDt);
  CHECK((slides.friction_impulse - Vec3d(-8, 0, 0)).norm() < 1e-12);
  CHECK_FALSE(slides.sticks);
  // In any direction across the normal, none along it.
  const Vec3d n = Vec3d(1, 2, 2) / 3.0, across = Vec3d(2, -2, 1) / 3.0;
  const auto oblique = solid::repel(-3.0 * n + 10.0 * across, n, 0.5, kMass, 1e6, 0.5, kDt);
  CHECK(oblique.normal_impulse == Approx(16.0));
  CHECK((oblique.friction_impulse - -8.0 * across).norm() < 1e-12);
  // mu = 2 would take 16 m/s: all of it goes.
  const auto sticks = solid::repel(v, kUp, 0.5, kMass, 1e6, 2.0, kDt);
  CHECK((sticks.friction_impulse - Vec3d(-20, 0, 0)).norm() < 1e-12);
  CHECK(sticks.sticks);
  // None without mu, without a push, or where nothing slides.
  CHECK(solid::repel(v, kUp, 0.5, kMass, 1e6, 0.0, kDt).friction_impulse.isZero(0));
  CHECK(solid::repel({10, 6, 0}, kUp, 0.5, kMass, 1e6, 0.5, kDt).friction_impulse.isZero(0));
  CHECK(solid::repel({0, -3, 0}, kUp, 0.5, kMass, 1e6, 0.5, kDt).friction_impulse.isZero(0));
}

TEST_CASE("Two particles that answer to each other keep their momentum when they weigh the same, and not otherwise",
          "[law]") {
  // Each sees the other's velocity before the step, as the particles of two solids do.
  const auto momentum_change = [](double m, double other, double k) -> Vec3d {
    const Vec3d v(1, 0, 0), w(-2, 0, 0), n(-1, 0, 0);  // out of the other
    return solid::repel(v - w, n, 0.01, m, k, 0.0, kDt).normal_impulse * n +
           solid::repel(w - v, -n, 0.01, other, k, 0.0, kDt).normal_impulse * -n;
  };
  CHECK(momentum_change(kMass, kMass, 1e6).norm() < 1e-12);
  // Where the spring decides both get the same, whatever they weigh.
  CHECK(momentum_change(kMass, 3.0 * kMass, 1.0).norm() < 1e-12);
  // Else (m' - m) (0.1 d / dt - v_N) is made, here (6 - 2) kg times 3.1 m/s.
  CHECK(momentum_change(kMass, 3.0 * kMass, 1e6)[0] == Approx(4.0 * 3.1));
}
