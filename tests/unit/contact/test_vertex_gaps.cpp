// Purpose: what a vertex of one solid sees of the surface of another, however that is turned and strained.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "contact/solid_contact.hpp"
#include "unit/sim/two_solids.hpp"

using namespace efsi;
using namespace efsi::test;

TEST_CASE("A vertex sees the gap to a turned and squashed ball, and how fast it closes") {
  const double squash = GENERATE(1.0, 0.5), angle = GENERATE(0.0, 0.4 * M_PI, M_PI);
  constexpr double kSmall = 0.02, kRadius = 0.1, kAbove = 0.5 * kSmall;
  const Vec3d middle(0.2, 0.2, 0.2), closing(0.3, -1.0, 0.2);
  TwoSolids s(make_ball(cube_grid(20, kSmall), {}, middle, kRadius));
  const Mat3d turn = Eigen::AngleAxisd(angle, Vec3d::UnitZ()).toRotationMatrix();
  const Mat3d f = Vec3d(1.0, squash, 1.0).asDiagonal() * turn;
  set_displacement(s.body, [&](const Vec3d& x) { return Vec3d(x - middle - f.inverse() * (x - middle)); });
  s.place_vertex(middle + Vec3d(0.0, squash * kRadius + kAbove, 0.0), closing);
  std::size_t seen = 0;
  s.look([&](const sim::SeenVertex& vertex) {
    ++seen;
    const auto [gap, approach] = vertex.gap();
    CHECK(gap / kSmall == Approx(kAbove / kSmall - sim::kContactSkin).margin(0.03));
    CHECK(approach == Approx(1.0).epsilon(0.02));  // along y alone
    CHECK(vertex.rest_distance == Approx(kAbove / squash).margin(0.03 * kSmall));
    CHECK((turn * vertex.rest_normal() - Vec3d::UnitY()).norm() < 0.05);
  });
  CHECK(seen == 1);
}
