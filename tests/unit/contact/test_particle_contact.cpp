// Purpose: contact of the preset paper2016: particles that repel each other, at solids and at walls.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "base/error.hpp"
#include "contact/particle_contact.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

sim::Params paper_params(const Vec3d& size, bool fluid, int threads = 1) {
  sim::Params p = still(size, kCell, fluid);
  p.threads = threads;
  p.numerics = sim::numerics_of(sim::Preset::kPaper2016);
  return p;
}

// Two balls of ten cells across that fly into each other at 2 m/s.
std::vector<sim::SolidDesc> colliding_balls(double stiffness = 10000.0, double off = 0.0, double friction = 0.0) {
  std::vector<sim::SolidDesc> balls = {ball_desc({0.36, 0.25 - 0.5 * off, 0.21}),
                                       ball_desc({0.64, 0.25 + 0.5 * off, 0.21})};
  balls[0].velocity = {1.0, 0.0, 0.0};
  balls[1].velocity = {-1.0, 0.0, 0.0};
  for (auto& ball : balls) {
    ball.contact_stiffness = stiffness;
    ball.friction = friction;
  }
  return balls;
}

const Vec3d kBox(1.0, 0.5, 0.42);

struct Collision {
  double distance = 0.0;        // of the centres at the end [m]
  Vec3d speed = Vec3d::Zero();  // of the first at the end [m/s]
  double gained = 0.0;          // change of the sum of the momenta over that of one [kg m/s]
  double spin = 0.0;            // angular momentum of the first along z [kg m^2/s]
  double deepest = -1e9;        // [cells]
  std::uint64_t pushed = 0, stuck = 0;
};

Collision collide(const sim::Params& p, const std::vector<sim::SolidDesc>& balls, double end = 0.3) {
  auto s = make_simulation(p, balls);
  const auto sum = [&] { return Vec3d(s->diagnose_solid(0).momentum + s->diagnose_solid(1).momentum); };
  const Vec3d first = sum();
  const double one = s->diagnose_solid(0).momentum.norm();
  Collision out;
  while (s->state().time < end - 1e-9) {
    s->step(std::min(0.01, end - s->state().time));
    for (const sim::ContactPair& pair : s->contacts()) {
      out.deepest = std::max(out.deepest, pair.surface_overlap);
      out.pushed += pair.active_rows;
      out.stuck += pair.sticking_rows;
    }
  }
  const auto a = s->diagnose_solid(0), b = s->diagnose_solid(1);
  out.distance = (a.center - b.center).norm();
  out.speed = a.momentum / a.mass;
  out.gained = (sum() - first).norm() / one;
  out.spin = a.angular_momentum[2];
  return out;
}

}  // namespace

TEST_CASE("Balls that meet part again by repulsion from one cell on, in vacuum and in a fluid; without it they stick",
          "[law][nightly]") {
  for (const bool fluid : {false, true}) {
    const sim::Params p = paper_params(kBox, fluid);
    CHECK(p.numerics.contact_distance == 1.0);
    const Collision apart = collide(p, colliding_balls());
    CHECK(apart.pushed > 500);
    CHECK(apart.speed[0] < -0.4);  // of 1 m/s
    CHECK(apart.speed[0] > -0.8);  // and no energy is made
    CHECK(apart.distance > 0.2 + 2.0 * kCell);
    CHECK(apart.deepest < 0.5);
    CHECK(apart.gained < 0.01);  // they weigh the same
    const Collision stuck = collide(p, colliding_balls(0.0));
    CHECK(stuck.pushed == 0);
    CHECK(stuck.distance < 0.2 + 0.5 * kCell);
    CHECK(std::abs(stuck.speed[0]) < 0.2);
  }
}

TEST_CASE("The stiffness of Eq. 14 does nothing where a step's spring impulse is more than a particle's momentum",
          "[nightly]") {
  // dt k h against m v: above k = rho h^2 v / (8 dt), some 10 N/m here, the second term of the minimum decides.
  const sim::Params p = paper_params(kBox, false);
  const Collision hard = collide(p, colliding_balls(10000.0));
  for (const double k : {100.0, 1000.0, 100000.0})
    CHECK(collide(p, colliding_balls(k)).speed[0] == Approx(hard.speed[0]).epsilon(0.01));
  CHECK(std::abs(collide(p, colliding_balls(1.0)).speed[0] - hard.speed[0]) > 0.005);
}

TEST_CASE("The constraint helps collisions: with it fewer particles are pushed, and less deep", "[law][nightly]") {
  // Sec. 4.6 and 5.1. Off: foam in vacuum, as without the constraint nothing keeps a fluid; on: solids that keep their
  // volume, in a fluid of nearly their density.
  std::vector<sim::SolidDesc> foam = colliding_balls();
  for (auto& ball : foam) ball.compressible = true;
  const Collision off = collide(paper_params(kBox, false), foam);
  sim::Params p = paper_params(kBox, true);
  p.fluid.density = 770.0;
  const Collision on = collide(p, colliding_balls());
  CHECK(off.pushed > 1000);
  CHECK(on.pushed < 0.85 * static_cast<double>(off.pushed));
  CHECK(on.deepest < off.deepest - 0.2);
  // Without repulsion they stick, with the constraint and without.
  CHECK(collide(p, colliding_balls(0.0)).distance < 0.2 + kCell);
  for (auto& ball : foam) ball.contact_stiffness = 0.0;
  CHECK(collide(paper_params(kBox, false), foam).distance < 0.2 + kCell);
}

TEST_CASE("The constraint of the solids alone changes a collision little: what helps is that of the fluid",
          "[law][nightly]") {
  for (const double fluid : {0.0, 770.0}) {
    sim::Params p = paper_params(kBox, fluid > 0.0);
    if (fluid > 0.0) p.fluid.density = fluid;
    std::vector<sim::SolidDesc> foam = colliding_balls();
    for (auto& ball : foam) ball.compressible = true;
    const Collision off = collide(p, foam), on = collide(p, colliding_balls());
    INFO("fluid " << fluid << " kg/m^3: off: " << off.pushed << " pushed, deepest " << off.deepest << ", "
                  << off.speed[0] << " m/s; on: " << on.pushed << ", " << on.deepest << ", " << on.speed[0] << " m/s");
    CHECK(static_cast<double>(on.pushed) == Approx(static_cast<double>(off.pushed)).epsilon(0.05));
    CHECK(on.deepest < off.deepest);
    CHECK(on.deepest > off.deepest - 0.1);
    CHECK(on.speed[0] == Approx(off.speed[0]).margin(0.1));
  }
}

TEST_CASE("Friction turns balls that meet off centre") {
  const sim::Params p = paper_params(kBox, false);
  const Collision smooth = collide(p, colliding_balls(10000.0, 0.06)),
                  rough = collide(p, colliding_balls(10000.0, 0.06, 0.5));
  CHECK(smooth.stuck == 0);
  CHECK(rough.stuck > 0);
  // The first passes below the second, which drags its upper side back: it turns like a wheel on the other's underside.
  CHECK(rough.spin > smooth.spin + 1e-4);
  CHECK(smooth.distance > 0.2 + kCell);
  CHECK(rough.distance > 0.2 + kCell);
}

TEST_CASE("A ball that falls is held up by the floor's repulsion, and is thrown back") {
  sim::Params p = paper_params({0.4, 0.5, 0.4}, true);
  p.gravity = {0.0, -9.8, 0.0};
  sim::SolidDesc ball = ball_desc({0.2, 0.2, 0.2});
  ball.velocity = {0.0, -1.5, 0.0};
  const auto rebound = [&](double stiffness, double& lowest) {
    ball.contact_stiffness = stiffness;
    auto s = make_simulation(p, {ball});
    double fastest = 0.0;
    lowest = 1.0;
    for (int n = 0; n < 16; ++n) {
      s->advance(0.0125, {});
      const auto now = s->diagnose_solid(0);
      fastest = std::max(fastest, now.momentum[1] / now.mass);
      lowest = std::min(lowest, now.extent_min[1]);
    }
    return fastest;
  };
  double with = 0.0, without = 0.0;
  const double bounced = rebound(10000.0, with);
  rebound(0.0, without);
  CHECK(bounced > 0.4);
  CHECK(bounced < 1.5);
  CHECK(with > 0.0);
  CHECK(without < 0.0);
}

TEST_CASE("Friction of Eq. 15 brakes a block on the floor, and a no-slip wall holds what lies in its cells") {
  sim::Params p = paper_params({0.8, 0.3, 0.4}, false);
  p.gravity = {0.0, -9.8, 0.0};
  sim::SolidDesc desc = desc_of(block({0.2, 0.092, 0.2}, {0.1, 0.08, 0.1}));  // 0.6 cells above the floor
  desc.youngs_modulus = 1e5;
  desc.rayleigh_alpha = 0.0;
  desc.velocity = {1.0, 0.0, 0.0};
  const auto speed = [&](double friction) {
    desc.friction = friction;
    auto s = make_simulation(p, {desc});
    while (s->state().time < 0.1) s->step(0.005);
    const auto now = s->diagnose_solid(0);
    return now.momentum[0] / now.mass;
  };
  const double smooth = speed(0.0), rough = speed(0.5);
  CHECK(smooth > 0.9);
  CHECK(rough < smooth - 0.2);
  p.walls.face[2] = grid::Wall::kNoSlip;
  CHECK(speed(0.0) < smooth - 0.2);
}

TEST_CASE("Solids less than two cells apart take steps of CFL 0.6") {
  sim::Params p = paper_params(kBox, false);
  for (const double gap : {1.5, 3.5}) {
    std::vector<sim::SolidDesc> balls = {ball_desc({0.36, 0.25, 0.21}), ball_desc({0.56 + gap * kCell, 0.25, 0.21})};
    balls[0].velocity = balls[1].velocity = {1.0, 0.0, 0.0};
    auto s = make_simulation(p, balls);
    const double cells = s->step(1.0).dt * 1.0 / kCell;
    CHECK(cells == Approx(gap < 2.0 ? 0.6 : 1.8).epsilon(0.05));
  }
}

TEST_CASE("A collider pushes the particles of a solid, and has none") {
  sim::Params p = paper_params({0.6, 0.4, 0.4}, false);
  auto s = make_simulation(p, {});
  geometry::MeshReport report;
  sim::SolidDesc wall = desc_of(block({0.1, 0.2, 0.2}, {0.06, 0.15, 0.15}));
  s->add_collider(wall, report);
  sim::SolidDesc ball = ball_desc({0.3, 0.2, 0.2}, 0.1);
  ball.velocity = {-1.0, 0.0, 0.0};
  s->add_solid(ball, report);
  Vec3d impulse = Vec3d::Zero();
  for (int n = 0; n < 25; ++n) {
    s->step(0.01);
    for (const sim::ContactPair& pair : s->contacts()) impulse += pair.impulse;
  }
  CHECK(s->workspace().particles[0].size() == 0);
  CHECK(s->workspace().particles[1].size() > 1000);
  CHECK(impulse[0] > 0.2);  // kg m/s; the rest goes by way of the nodes that both carry
  CHECK(s->diagnose_solid(1).momentum[0] > 0.3 * s->diagnose_solid(1).mass);
}

TEST_CASE("Without the preset there are no particles and no tree of triangles") {
  sim::Params p = paper_params(kBox, false);
  p.numerics = sim::numerics_of(sim::Preset::kProduction);
  auto s = make_simulation(p, colliding_balls());
  s->step(0.01);
  CHECK(s->workspace().particles.empty());
  CHECK(s->solids()[0].nearest.bytes() == 0);
  CHECK_FALSE(p.numerics.uses_particles());
}
