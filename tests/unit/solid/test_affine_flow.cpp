// Purpose: the affine motion nearest to a solid's velocity that leaves walls where they are, and where it leads.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <functional>

#include "solid/affine_flow.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const Vec3d kMiddle(0.183, 0.176, 0.181);

solid::AffineFlow fit_ball(const std::function<Vec3d(const Vec3d&)>& velocity, const solid::WallPlanes& walls,
                           bool keeps_volume, int threads = 1) {
  const material::Elastic soft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);
  TestSolid s = make_ball(cube_grid(18, 0.02), soft, kMiddle, 0.1);
  solid::compute_mass(Parallel(threads), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const Vec3i at = g.node_place(n);
    s.state.v.set(n, velocity(g.node_position(at[0], at[1], at[2])).cast<Real>());
  }
  return solid::fit_affine_flow(Parallel(threads), s.state.band, s.work, g, s.state.v, walls, keeps_volume);
}

Vec3d flow_at(const solid::AffineFlow& flow, const Vec3d& x) { return flow.drift + flow.gradient * (x - flow.anchor); }

}  // namespace

TEST_CASE("An affine velocity is its own fit, without walls and with one that it leaves where it is", "[law]") {
  const double floor = 0.07;
  Mat3d gradient;
  gradient << 1.0, -2.0, 0.5, 0.0, -3.0, 0.0, 0.25, 1.5, 2.0;
  const auto velocity = [&](const Vec3d& x) -> Vec3d {
    return Vec3d(0.3, 0.0, -0.2) + gradient * (x - Vec3d(0.2, floor, 0.1));
  };
  for (const unsigned axes : {0u, 2u}) {
    const solid::AffineFlow flow = fit_ball(velocity, {axes, 0, {kMiddle[0], floor, kMiddle[2]}}, true);
    CHECK((flow.gradient - gradient).norm() < 1e-5);
    for (const Vec3d& x : {Vec3d(0.1, 0.2, 0.15), Vec3d(0.25, floor, 0.2)})
      CHECK((flow_at(flow, x) - velocity(x)).norm() < 1e-6);
    CHECK(flow.at_rest() == false);
  }
}

TEST_CASE("Any velocity's fit leaves walls where they are, and keeps the volume if it is asked to", "[law]") {
  const auto velocity = [](const Vec3d& x) -> Vec3d {
    return {std::sin(20.0 * x[1]), -2.0 + x[0] + 30.0 * x[1] * x[1], 4.0 * x[2] * x[0] - x[1]};
  };
  const Vec3d corner(0.08, 0.07, 0.28);
  for (const unsigned axes : {2u, 5u, 7u})
    for (const unsigned opposite : {0u, 1u, 7u}) {
      const solid::AffineFlow flow = fit_ball(velocity, {axes, opposite & axes, corner}, true, 2);
      CHECK(std::abs(flow.gradient.trace()) < 1e-12);
      for (int a = 0; a < 3; ++a) {
        if (!(axes >> a & 1)) continue;
        Vec3d x(0.3, -0.4, 0.7);
        x[a] = corner[a];
        CHECK(flow_at(flow, x)[a] == 0.0);
        const solid::AffineStep step = solid::affine_step(flow, 0.02);
        CHECK(std::abs((step.shift + step.forward * (x - flow.anchor))[a]) < 1e-15);
        if (opposite & axes & 1u << a) CHECK(flow.gradient(a, a) == 0.0);
      }
    }
  CHECK(std::abs(fit_ball(velocity, {2u, 0u, corner}, false).gradient.trace()) > 0.1);
  CHECK(fit_ball([](const Vec3d&) { return Vec3d(Vec3d::Zero()); }, {2u, 0u, corner}, true).at_rest());
}

TEST_CASE("Two halves of a step along an affine flow are the whole, back is back, and no volume is lost", "[law]") {
  solid::AffineFlow flow;
  flow.anchor = {0.1, 0.2, 0.3};
  flow.drift = {1.0, -0.5, 0.2};
  flow.gradient << 3.0, -8.0, 1.0, 9.0, -5.0, 0.5, 0.0, 2.0, 2.0;
  const auto moved = [&](const Vec3d& x, double dt) -> Vec3d {
    const solid::AffineStep step = solid::affine_step(flow, dt);
    return x + step.shift + step.forward * (x - flow.anchor);
  };
  const Vec3d x(0.4, -0.1, 0.25);
  const double dt = 0.05;
  CHECK((moved(moved(x, 0.5 * dt), 0.5 * dt) - moved(x, dt)).norm() < 1e-14);
  const solid::AffineStep step = solid::affine_step(flow, dt);
  const Vec3d y = moved(x, dt);
  CHECK((y - step.shift + step.back * (y - flow.anchor - step.shift) - x).norm() < 1e-14);
  CHECK((Mat3d::Identity() + step.forward).determinant() == Approx(1.0).epsilon(1e-12));
  const double little = 1e-6;
  CHECK(((moved(x, little) - x) / little - flow_at(flow, x)).norm() < 1e-4);
}
