// Purpose: which solids touch what, and what follows from it.
#include "contact/hold.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const sim::Hold kFree{}, kOnFloor{2u}, kOnSolid{7u};

solid::Momenta moving(const Vec3d& velocity) {
  solid::Momenta m;
  m.mass = 2.0;
  m.linear = m.mass * velocity;
  m.inertia.setIdentity();
  return m;
}

}  // namespace

TEST_CASE("Solids that push each other are a cluster, held altogether; one alone by the walls that it touches") {
  sim::Params p = still_vacuum({1.0, 0.5, 0.5}, 0.025);
  // The first and the third touch the fourth; the second meets the floor, the fifth is free.
  std::vector<sim::SolidDesc> balls = {ball_desc({0.205, 0.25, 0.25}, 0.08), ball_desc({0.75, 0.08, 0.15}, 0.08),
                                       ball_desc({0.495, 0.25, 0.25}, 0.08), ball_desc({0.35, 0.25, 0.25}, 0.075),
                                       ball_desc({0.85, 0.3, 0.35}, 0.08)};
  balls[1].velocity = {0.0, -1.0, 0.0};
  auto s = make_simulation(p, balls);
  s->step(5e-3);
  const sim::Holds& holds = s->workspace().elasticity.holds;
  REQUIRE(holds.clusters.size() == 3);
  CHECK(holds.clusters[0].solids == std::vector<std::size_t>{0, 2, 3});
  CHECK(holds.clusters[1].solids == std::vector<std::size_t>{1});
  CHECK(holds.clusters[2].solids == std::vector<std::size_t>{4});
  for (const std::size_t l : {0u, 2u, 3u}) CHECK(holds.of(l).axes == kOnSolid.axes);
  CHECK(holds.of(1).axes == kOnFloor.axes);
  CHECK_FALSE(holds.of(4).touches());
}

TEST_CASE(
    "What a wall holds loses its choice of elements when it is fast, what touches anything its frame and its film") {
  CHECK(sim::has_element_hysteresis(false, 3.0));
  CHECK(sim::has_element_hysteresis(true, 0.29));
  CHECK_FALSE(sim::has_element_hysteresis(true, 0.31));

  CHECK(sim::shares_while(false, 0.5, 0.01, 1.0).behind > 0.0);
  CHECK(sim::shares_while(true, 0.5, 0.01, 1.0).behind == 0.0);

  solid::SolidRest rest;
  rest.area = 6.0;
  rest.volume = 1.0;
  const double h = 0.1, film = 0.003;
  CHECK(sim::lost_beyond_film(kFree, rest, h, 0.002) == 0.0);
  CHECK(sim::lost_beyond_film(kFree, rest, h, -0.004) == Approx(film - 0.004));
  CHECK(sim::lost_beyond_film(kFree, rest, h, 0.004) == Approx(0.004 - film));
  CHECK(sim::lost_beyond_film(kOnSolid, rest, h, 0.002) == 0.002);
}

TEST_CASE("A free body's field rides on its motion; a held one's rests on the grid and slides along the wall") {
  const double dt = 0.1;
  const solid::Momenta before = moving({1.0, -2.0, 0.0}), after = moving({3.0, 0.0, 0.0});
  const solid::BodyStep free = sim::transport_frame(kFree, before, after, dt);
  CHECK((free.shift - dt * Vec3d(2.0, -1.0, 0.0)).norm() < 1e-14);
  CHECK((free.velocity.linear - Vec3d(3.0, 0.0, 0.0)).norm() < 1e-14);
  const solid::BodyStep slides = sim::transport_frame(kOnFloor, before, after, dt);
  CHECK((slides.shift - dt * Vec3d(-1.0, 0.0, 0.0)).norm() < 1e-14);
  CHECK(slides.velocity.linear.norm() == 0.0);
  CHECK(sim::transport_frame(kOnSolid, before, after, dt).shift.norm() == 0.0);
}

TEST_CASE("Solids that only hold each other ride on the motion of both; one that a wall holds rests on the grid") {
  const double dt = 0.1;
  std::vector<solid::Momenta> before = {moving({1.0, 0.0, 0.0}), moving({-1.0, 2.0, 0.0}), moving({5.0, 0.0, 0.0})};
  before[1].center = {0.0, 0.0, 3.0};
  sim::Holds holds;
  holds.clusters = {{{0, 1}, kOnSolid, 0}, {{2}, kFree, 0}};
  holds.cluster_of = {0, 0, 1};
  REQUIRE(holds.clusters[0].floats());
  REQUIRE_FALSE(holds.clusters[1].floats());
  std::vector<solid::BodyStep> frames = sim::transport_frames(holds, before, before, dt);
  for (const std::size_t l : {0u, 1u}) {
    CHECK((frames[l].shift - dt * Vec3d(0.0, 1.0, 0.0)).norm() < 1e-12);
    CHECK((frames[l].velocity.center - Vec3d(0.0, 0.0, 1.5)).norm() < 1e-12);
    // Angular momentum (-6, -6, 0); moments of inertia 2 * 1 + 4 * 1.5^2 across the line between them.
    CHECK((frames[l].velocity.angular - Vec3d(-6.0 / 11.0, -6.0 / 11.0, 0.0)).norm() < 1e-12);
  }
  CHECK((frames[2].shift - dt * Vec3d(5.0, 0.0, 0.0)).norm() < 1e-12);
  holds.clusters[0].walls = 2;
  frames = sim::transport_frames(holds, before, before, dt);
  for (const std::size_t l : {0u, 1u}) CHECK(frames[l].velocity.linear.norm() == 0.0);
  CHECK(sim::transport_frames(holds, {}, {}, dt)[2].shift.norm() == 0.0);
}
