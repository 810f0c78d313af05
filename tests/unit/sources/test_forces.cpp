// Purpose: forces in a region: their laws, where and when they act, on what, and their noise.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "frame/force_field.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using sim::ForceField;

namespace {

const Vec3d kMiddle(0.3, 0.3, 0.3);

// A box of this size around a place.
ForceField force_at(ForceField::Kind kind, const Vec3d& middle, const Vec3d& size) {
  ForceField f;
  Eigen::Matrix4d to_world = Eigen::Matrix4d::Identity();
  to_world.topLeftCorner<3, 3>() = size.asDiagonal();
  to_world.topRightCorner<3, 1>() = middle;
  f.from_world = to_world.inverse();
  f.kind = kind;
  f.end_time = 1e6;
  return f;
}

ForceField everywhere(ForceField::Kind kind) { return force_at(kind, kMiddle, Vec3d::Constant(2.0)); }

sim::Params box(bool fluid = false) { return still(Vec3d::Constant(0.6), 0.025, fluid); }

SimulationPtr pushed_ball(const sim::Params& p, const ForceField& force) {
  auto s = make_simulation(p, {ball_desc(kMiddle, 0.1)});
  s->add_force(force);
  return s;
}

}  // namespace

TEST_CASE("A constant force on a free solid gives m a", "[law]") {
  const Vec3d acceleration(3.0, -1.0, 0.5);
  ForceField force = everywhere(ForceField::Kind::kConstant);
  force.acceleration = acceleration;
  auto s = pushed_ball(box(), force);
  const double time = 0.2;
  advance_by(*s, time, 0.01);
  const sim::SolidDiagnostics d = s->diagnose_solid(0);
  CHECK((d.momentum - d.mass * time * acceleration).norm() < 1e-3 * d.momentum.norm());
  CHECK((d.center - kMiddle - 0.5 * time * time * acceleration).norm() < 5e-3 * 0.5 * time * time * 3.2);
}

TEST_CASE("A force acts while it is on, to the part of a step, and on what it names") {
  ForceField force = everywhere(ForceField::Kind::kConstant);
  force.acceleration = {2.0, 0, 0};
  force.start_time = 0.013;
  force.end_time = 0.047;
  const auto momentum = [&](ForceField::ActsOn on) {
    force.acts_on = on;
    auto s = pushed_ball(box(), force);
    advance_by(*s, 0.08, 0.01);
    const sim::SolidDiagnostics d = s->diagnose_solid(0);
    return d.momentum[0] / d.mass;
  };
  CHECK(momentum(ForceField::ActsOn::kBoth) == Approx(2.0 * 0.034).epsilon(1e-3));
  CHECK(momentum(ForceField::ActsOn::kSolids) == Approx(2.0 * 0.034).epsilon(1e-3));
  CHECK(momentum(ForceField::ActsOn::kFluid) == 0.0);
}

TEST_CASE("A force acts in its region only") {
  ForceField force = force_at(ForceField::Kind::kConstant, {0.9, 0.3, 0.3}, Vec3d::Constant(0.2));
  force.acceleration = {2.0, 0, 0};
  auto s = pushed_ball(box(), force);
  advance_by(*s, 0.05, 0.01);
  CHECK(s->diagnose_solid(0).momentum.norm() == 0.0);
}

TEST_CASE("A radial force leads to and from the middle of its region") {
  for (const double strength : {-2.0, 2.0}) {
    ForceField force = force_at(ForceField::Kind::kRadial, {0.1, 0.3, 0.3}, Vec3d::Constant(1.0));
    force.radial_acceleration = strength;
    auto s = pushed_ball(box(), force);
    advance_by(*s, 0.02, 0.01);
    const sim::SolidDiagnostics d = s->diagnose_solid(0);
    // The mean of x / |x| over a ball of half the distance: 1 - (R/d)^2 / 5.
    CHECK(d.momentum[0] / d.mass == Approx(strength * 0.02 * (1.0 - 0.05)).epsilon(0.02));
    CHECK(std::abs(d.momentum[1]) + std::abs(d.momentum[2]) < 1e-3 * std::abs(d.momentum[0]));
  }
}

TEST_CASE("What a radial force presses together strains as elasticity says, whatever the steps", "[law]") {
  // Towards the middle with a per mass, lambda = mu: u(R) = -0.15 rho a R^2 / (lambda + 2 mu), at rest.
  constexpr double kRadius = 0.1, kShear = 2.4e4, kAcceleration = 80.0;
  const double wanted = 3.0 * 0.15 * 1000.0 * kAcceleration * kRadius / (3.0 * kShear);
  ForceField force = everywhere(ForceField::Kind::kRadial);
  force.radial_acceleration = -kAcceleration;
  double last = 0.0;
  for (const double dt : {0.005, 0.0025}) {
    sim::Params p = box();
    p.voxel_size = 0.02;
    sim::SolidDesc ball = ball_desc(kMiddle, kRadius);
    ball.youngs_modulus = 2.5 * kShear;
    ball.poissons_ratio = 0.25;
    ball.compressible = true;
    ball.rayleigh_beta = 0.005;
    const auto s = make_simulation(p, {ball});
    s->add_force(force);
    advance_by(*s, 0.3, dt);
    const sim::SolidDiagnostics d = s->diagnose_solid(0);
    const double lost = 1.0 - d.volume_mesh / d.rest_volume;
    INFO("steps of " << dt << " s: loses " << lost << " of its volume, " << wanted << " by elasticity");
    CHECK(d.kinetic_energy < 1e-5 * d.elastic_energy);
    CHECK(lost == Approx(wanted).epsilon(0.05));
    if (last > 0.0) CHECK(lost == Approx(last).epsilon(0.005));
    last = lost;
  }
}

TEST_CASE("Wind takes a fluid along at its rate, whatever the steps", "[law]") {
  sim::Params p = box(true);
  p.walls.face.fill(grid::Wall::kPeriodic);
  const double drag = 4.0, time = 0.25;
  const Vec3d wind(0.3, 0.0, -0.1);
  ForceField force = everywhere(ForceField::Kind::kWind);
  force.wind_velocity = wind;
  force.wind_drag = drag;
  for (const double dt : {0.05, 0.125}) {
    auto s = make_simulation(p);
    s->add_force(force);
    advance_by(*s, time, dt);
    const Vec3d expected = wind * (1.0 - std::exp(-drag * time));
    const grid::VectorField& v = s->state().fluid.velocity;
    for (std::size_t n = 0; n < v.size(); n += 101)
      CHECK((v.at(n).cast<double>() - expected).norm() < 1e-4 * expected.norm());
  }
}

TEST_CASE("What acts on solids alone leaves the fluid beside them in place at first") {
  ForceField force = everywhere(ForceField::Kind::kConstant);
  force.acceleration = {5.0, 0, 0};
  force.acts_on = ForceField::ActsOn::kSolids;
  sim::Params p = box(true);
  p.energy_ledger = true;
  auto s = pushed_ball(p, force);
  const sim::StepInfo info = s->step(0.001);
  const sim::SolidDiagnostics d = s->diagnose_solid(0);
  CHECK(d.momentum[0] / d.mass == Approx(0.005).epsilon(0.01));
  const sim::Energy& outside = info.energy->change[static_cast<std::size_t>(sim::EnergyStage::kExternal)];
  CHECK(outside.solid_kinetic == Approx(0.5 * d.mass * 0.005 * 0.005).epsilon(0.01));
  CHECK(outside.fluid_kinetic == Approx(0.0).margin(1e-12));
}

TEST_CASE("Noise has no divergence, a mean square of 1, and changes with time") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(-30.0, 30.0);
  double squares = 0.0, correlated = 0.0;
  constexpr int kSamples = 4000;
  for (int n = 0; n < kSamples; ++n) {
    const Vec3d x(place(random), place(random), place(random));
    const double time = place(random), step = 1e-5;
    const Vec3d v = sim::noise_velocity(x, time);
    squares += v.squaredNorm();
    correlated += v.dot(sim::noise_velocity(x, time + 2.0));
    double divergence = 0.0;
    for (int a = 0; a < 3; ++a) {
      const Vec3d along = step * Vec3d::Unit(a);
      divergence += (sim::noise_velocity(x + along, time)[a] - sim::noise_velocity(x - along, time)[a]) / (2.0 * step);
    }
    REQUIRE(std::abs(divergence) < 1e-4);
  }
  CHECK(squares / kSamples == Approx(1.0).epsilon(0.05));
  CHECK(std::abs(correlated) / kSamples < 0.1);
  CHECK(sim::noise_velocity({0.3, -1.7, 2.2}, 0.4) == sim::noise_velocity({0.3, -1.7, 2.2}, 0.4));
}

TEST_CASE("A force that ends before it starts is refused; forces tell scenes apart") {
  ForceField force = everywhere(ForceField::Kind::kWind);
  force.wind_velocity = {1.0, 0, 0};
  force.noise_speed = 0.5;
  force.noise_frequency = 3.0;
  auto with = pushed_ball(box(), force), without = make_simulation(box(), {ball_desc(kMiddle, 0.1)});
  CHECK(with->scene_hash() != without->scene_hash());
  force.start_time = 2.0;
  force.end_time = 1.0;
  CHECK_THROWS_WITH(with->add_force(force),
                    Catch::Contains("EfsiForceDef.end_time = 1: must be at least start_time, 2"));
}
