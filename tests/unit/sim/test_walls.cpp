// Purpose: walls push solids and never pull them, and rub them by Coulomb's law.
#include <catch2/catch.hpp>
#include <cmath>

#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kGravity = 9.8;

double lowest_vertex(const sim::Simulation& s) {
  double low = 1e30;
  for (const Vec3d& x : s.state().solids[0].surface) low = std::min(low, x[1]);
  return low;
}

// A block of 0.2 x 0.1 x 0.2 m on the floor.
geometry::TriangleMesh block(const Vec3d& center) {
  geometry::TriangleMesh mesh;
  for (int c = 0; c < 8; ++c)
    mesh.points.push_back(center + Vec3d(c & 1 ? 0.1 : -0.1, c & 2 ? 0.05 : -0.05, c & 4 ? 0.1 : -0.1));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// Gravity is tilted by 30 degrees against the floor.
SimulationPtr block_on_slope(double friction, bool compressible) {
  sim::Params p = vacuum({1.0, 0.2, 0.4});
  p.max_time_step = 1.0 / 96.0;
  p.gravity = kGravity * Vec3d(std::sin(M_PI / 6), -std::cos(M_PI / 6), 0.0);
  sim::SolidDesc d = desc_of(block({0.2, 0.05, 0.2}));
  d.youngs_modulus = 2e5;
  d.poissons_ratio = 0.2;
  d.rayleigh_beta = 2e-3;
  d.compressible = compressible;
  d.friction = friction;
  return make_simulation(p, {d});
}

Vec3d speed(sim::Simulation& s) {
  const auto now = s.diagnose_solid(0);
  return now.momentum / now.mass;
}

}  // namespace

TEST_CASE("A ball leaves the floor wholly, and rises as high as the speed says at which it leaves", "[law]") {
  const double across = GENERATE(10.0, 13.0);
  const bool fluid = GENERATE(false, true);
  sim::Params p = box_params({0.4, 0.5, 0.4}, 0.2 / across);
  p.fluid.present = fluid;
  p.max_time_step = 0.01;  // not to step over the apex
  sim::SolidDesc d = ball_desc({0.2, 0.13, 0.2});
  d.velocity = {0.0, -2.5, 0.0};
  auto s = make_simulation(p, {d});
  double deepest = 0.0, apex = 0.0, from = 0.0, expected = 0.0, off = 0.0;
  bool touched = false, free = false;
  while (s->state().time < 0.5) {
    s->step(0.5 - s->state().time);
    const double low = lowest_vertex(*s);
    deepest = std::min(deepest, low);
    touched = touched || !s->state().solids[0].presses.empty();
    const auto now = s->diagnose_solid(0);
    const double up = now.momentum[1] / now.mass;
    if (touched && !free && up > 0.0 && low > 0.5 * p.voxel_size) {
      free = true;
      from = now.center[1];
      expected = 0.5 * up * up / kGravity;
    }
    if (free && now.center[1] > apex) {
      apex = now.center[1];
      off = low;
    }
    if (free && up < 0.0) break;
  }
  INFO(across << " across, fluid " << fluid << ": rises " << apex - from << " m for " << expected
              << " m, lowest vertex there " << off / p.voxel_size << " cells, deepest " << deepest / p.voxel_size);
  REQUIRE(free);
  CHECK(apex - from == Approx(expected).epsilon(0.05));
  CHECK(off > 2.0 * p.voxel_size);
  CHECK(deepest > -0.5 * p.voxel_size);
}

TEST_CASE("A ball that flies into a corner of two walls stays out of both", "[law]") {
  sim::Params p = box_params({0.4, 0.4, 0.4});
  sim::SolidDesc d = ball_desc({0.25, 0.15, 0.2});
  d.velocity = {2.0, -2.0, 0.0};
  auto s = make_simulation(p, {d});
  double deepest = 0.0;
  while (s->state().time < 0.15) {
    s->step(0.15 - s->state().time);
    for (const Vec3d& x : s->state().solids[0].surface) deepest = std::min({deepest, x[1], 0.4 - x[0]});
  }
  INFO("deepest vertex " << deepest / p.voxel_size << " cells");
  CHECK(deepest > -0.5 * p.voxel_size);
  CHECK(speed(*s)[0] < 0.0);
  CHECK(speed(*s)[1] > 0.0);
}

TEST_CASE("A ball that turns just above a floor is not disturbed by it", "[law]") {
  const bool compressible = GENERATE(true, false);
  sim::Params p = box_params({0.4, 0.4, 0.4});
  p.gravity = Vec3d::Zero();
  p.fluid.present = false;
  sim::SolidDesc d = ball_desc({0.2, 0.1 + 0.3 * p.voxel_size, 0.2});
  d.angular_velocity = {6.0, 0.0, 0.0};
  d.compressible = compressible;
  auto s = make_simulation(p, {d});
  s->step(0.01);
  const double before = s->diagnose_solid(0).kinetic_energy;
  double strained = 0.0;
  while (s->state().time < 0.5) {
    s->step(0.5 - s->state().time);
    strained = std::max(strained, s->diagnose_solid(0).elastic_energy);
  }
  INFO("elastic energy up to " << strained << " of " << before << " J, kinetic energy in the end "
                               << s->diagnose_solid(0).kinetic_energy);
  CHECK(strained < 0.01 * before);
  CHECK(s->diagnose_solid(0).kinetic_energy > 0.99 * before);
}

TEST_CASE("A ball at rest stays there whatever steps it is taken in", "[law]") {
  sim::Params p = vacuum({0.4, 0.36, 0.4});
  auto s = make_simulation(p, {ball_desc({0.2, 0.1, 0.2})});
  while (s->state().time < 4.0) s->step(1.0 / 96.0);
  const auto before = s->diagnose_solid(0);
  const double unit = before.mass * kGravity * 0.1;
  INFO("kinetic energy at rest " << before.kinetic_energy / unit << " m g R");
  CHECK(before.kinetic_energy < 1e-6 * unit);
  const auto check = [&](double dt, double energy, double cells) {
    s->step(dt);
    const auto now = s->diagnose_solid(0);
    INFO("after a step of " << dt << " s " << now.kinetic_energy / unit << " m g R");
    CHECK(now.kinetic_energy < energy * unit);
    CHECK(std::abs(now.center[1] - before.center[1]) < cells * p.voxel_size);
  };
  for (const double dt : {1.0 / 48.0, 1.0 / 48.0, 1.0 / 200.0, 1.0 / 48.0}) check(dt, 2e-5, 2e-3);
  for (const double dt : {1e-5, 1e-8, 1.0 / 48.0}) check(dt, 1e-3, 0.02);  // after it no pressure is known
}

TEST_CASE("What a wall has pulled it lets go in the next step", "[law]") {
  sim::Params p = vacuum({0.4, 0.4, 0.4});
  sim::SolidDesc d = ball_desc({0.2, 0.12, 0.2});
  d.velocity = {0.0, -2.0, 0.0};
  auto s = make_simulation(p, {d});
  std::size_t pulled = 0, again = 0;
  std::vector<std::size_t> last;
  while (s->state().time < 0.2) {
    s->step(0.2 - s->state().time);
    std::vector<std::size_t> now;
    for (const solid::WallPress& press : s->state().solids[0].presses) {
      if (press.force > 0) continue;
      now.push_back(s->grid().node(press.node[0], press.node[1], press.node[2]));
      again += static_cast<std::size_t>(std::count(last.begin(), last.end(), now.back()));
      ++pulled;
    }
    last = now;
  }
  INFO(pulled << " times a wall pulled a node, " << again << " times in two steps");
  CHECK(again <= pulled / 10);
}

TEST_CASE("A block slides down a slope as Coulomb's law says, or stays", "[law]") {
  const bool compressible = GENERATE(true, false);
  for (const double friction : {0.0, 0.2, 0.5}) {
    auto s = block_on_slope(friction, compressible);
    while (s->state().time < 0.2 - 1e-9) s->step(0.2 - s->state().time);
    const double early = speed(*s)[0];
    while (s->state().time < 0.4 - 1e-9) s->step(0.4 - s->state().time);
    const double exact = kGravity * (std::sin(M_PI / 6) - friction * std::cos(M_PI / 6));
    INFO("friction " << friction << ": " << (speed(*s)[0] - early) / 0.2 << " for " << exact << " m/s^2");
    CHECK((speed(*s)[0] - early) / 0.2 == Approx(exact).margin(0.01 * kGravity));
  }
  auto s = block_on_slope(0.6, compressible);  // tan 30 degrees: 0.577
  while (s->state().time < 0.5 - 1e-9) s->step(0.5 - s->state().time);
  const double from = s->diagnose_solid(0).center[0];
  while (s->state().time < 1.0 - 1e-9) s->step(1.0 - s->state().time);
  const double creep = (s->diagnose_solid(0).center[0] - from) / 12.0;
  INFO("creeps by " << creep / 0.02 << " cells in a frame");
  CHECK(std::abs(creep) < 1e-3 * 0.02);
}

TEST_CASE("A block that slides on flat ground stops where Coulomb's law says", "[law]") {
  sim::Params p = vacuum({1.0, 0.2, 0.4});
  p.max_time_step = 1.0 / 96.0;
  sim::SolidDesc d = desc_of(block({0.2, 0.05, 0.2}));
  d.youngs_modulus = 2e5;
  d.rayleigh_beta = 2e-3;
  d.friction = 0.4;
  d.velocity = {1.5, 0.0, 0.0};
  auto s = make_simulation(p, {d});
  while (s->state().time < 0.1 - 1e-9) s->step(0.1 - s->state().time);  // it has settled under its weight
  const double from = s->diagnose_solid(0).center[0], fast = speed(*s)[0];
  while (s->state().time < 0.6 - 1e-9) s->step(0.6 - s->state().time);
  const double way = s->diagnose_solid(0).center[0] - from, exact = fast * fast / (2.0 * 0.4 * kGravity);
  INFO("slides " << way << " m for " << exact);
  CHECK(way == Approx(exact).epsilon(0.04));
  CHECK(speed(*s).norm() < 0.01);
}
