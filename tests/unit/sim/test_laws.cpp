// Purpose: laws with exact answers that whole steps must keep, on grids coarse enough for seconds.
// The laboratory `./eulerfsi bench loop` measures the same laws, and more, at the resolutions that the bars are set
// for.
#include "unit/geometry/shapes.hpp"
#include "unit/sim/free_solid.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kShearModulus = 1e4;

// A ball in the middle of a cube of half-width `half`, `across` cells over its diameter.
SimulationPtr ball_in_cube(sim::Params p, double half, int across, double density = 1000.0, double damping = 0.0) {
  p.domain_size = Vec3d::Constant(2.0 * half);
  p.voxel_size = 2.0 * kBallRadius / across;
  sim::SolidDesc d = ball_desc(Vec3d::Constant(half), kBallRadius);
  d.density = density;
  d.rayleigh_beta = damping;
  return make_simulation(p, {d});
}

}  // namespace

TEST_CASE("A ball released from rest carries the added mass of the fluid around it", "[law]") {
  // C_m of a sphere in a cube of half-width 3 R; a = g (s - 1)/(s + C_m), s the density ratio; see
  // tests/bench/loop/reference.py. Eight cells per radius.
  constexpr double kAddedMass = 0.5344086;
  const auto [ratio, bar] = GENERATE(
      table<double, double>({{1e-3, 0.03}, {0.1, 0.1}, {0.5, 0.05}, {1.3, 0.03}, {10.0, 2e-3}, {1000.0, 1e-4}}));
  sim::Params p = box_params(Vec3d::Ones());
  p.fluid.density = 1000.0 / std::max(1.0, ratio);
  auto s = ball_in_cube(p, 3.0 * kBallRadius, 16, 1000.0 * std::min(1.0, ratio));
  s->step(0.005);
  const auto now = s->diagnose_solid(0);
  const double a = -now.momentum[1] / now.mass / 0.005 / 9.8;
  INFO("density ratio " << ratio << ": acceleration " << a << " g");
  CHECK(a == Approx((ratio - 1.0) / (ratio + kAddedMass)).epsilon(bar));
}

TEST_CASE("Solid and fluid in a periodic box keep their momentum", "[law]") {
  const double ratio = GENERATE(1000.0, 1.3);
  sim::Params p = still(Vec3d::Ones());
  p.walls.face.fill(grid::Wall::kPeriodic);
  p.fluid.density = 1000.0 / ratio;
  p.domain_size = Vec3d::Constant(0.4);
  p.voxel_size = 0.02;
  sim::SolidDesc d = ball_desc(Vec3d(0.18, 0.2, 0.2), kBallRadius);
  d.velocity = {0.4, 0.2, 0.0};
  auto s = make_simulation(p, {d});
  const auto momentum = [&] { return Vec3d(s->diagnose_solid(0).momentum + s->diagnose_fluid().momentum); };
  const Vec3d first = momentum();
  Vec3d last = first;
  for (int n = 0; n < 10; ++n) {
    s->step(0.005);
    const Vec3d now = momentum();
    CHECK((now - last).norm() < 1e-6 * first.norm());
    last = now;
  }
}

TEST_CASE("Noise in the map of a ball that flies through vacuum dies away at every speed", "[law][slow]") {
  // Elastic waves travel with the ball, whatever part of a cell it moves in a step.
  sim::Params p = still_vacuum({0.4, 1.6, 0.4});
  p.cfl_solid = 2.0;
  for (const double cells : {0.1, 0.5, 1.0, 1.3}) {
    sim::SolidDesc d = ball_desc({0.2, 0.14, 0.2}, kBallRadius);
    d.velocity = {0.0, cells * p.voxel_size / 0.002, 0.0};
    auto s = make_simulation(p, {d});
    s->set_solid_field(0, false, noise(3 * s->state().solids[0].band.grid.node_count(), 4e-5f).data());
    double start = 0.0, late = 0.0;
    for (int n = 0; n < 50; ++n) {
      s->step(0.002);
      const double energy = s->diagnose_solid(0).elastic_energy;
      if (n == 0) start = energy;
      if (n >= 40) late = std::max(late, energy);
    }
    INFO(cells << " cells per step: elastic energy " << start << " J after a step, " << late
               << " J at most in the last ten");
    CHECK(late < 0.75 * start);
  }
}

TEST_CASE("A ball hits the floor in small steps without losing its shape or gaining energy", "[law][slow]") {
  // 0.05 of a cell per step: whatever a step adds at the surface adds up here.
  sim::Params p = box_params({0.4, 0.3, 0.4});
  p.cfl_solid = 0.05;
  sim::SolidDesc d = ball_desc({0.2, 0.12, 0.2}, kBallRadius);
  d.velocity = {0.0, -4.0, 0.0};
  auto s = make_simulation(p, {d});
  const auto first = s->diagnose_solid(0);
  const auto energy = [](const auto& now) {
    return now.kinetic_energy + now.elastic_energy + now.mass * 9.8 * now.center[1];
  };
  double highest = 0.0, low = 1.0, high = 1.0, up = 0.0;
  std::uint64_t clamped = 0;
  while (s->state().time < 0.06) {
    const auto info = s->step(0.06 - s->state().time);
    const auto now = s->diagnose_solid(0);
    clamped += info.degenerate_cells;
    highest = std::max(highest, energy(now));
    low = std::min(low, info.min_det_f);
    high = std::max(high, info.max_det_f);
    up = std::max(up, now.momentum[1] / now.mass);
  }
  INFO("energy " << highest / energy(first) << ", det F " << low << " to " << high << ", up " << up << " m/s");
  CHECK(clamped == 0);
  CHECK(highest < 1.1 * energy(first));
  CHECK(up > 1.5);
}

TEST_CASE("An impact is as calm at any Poisson's ratio of a solid that keeps its volume", "[law][nightly]") {
  // Down and up again, to where the solid begins to leave the floor.
  const double ratio = GENERATE(0.0, 0.3, 0.499);
  const auto law = GENERATE(material::Law::kCorotational, material::Law::kStableNeoHookean);
  sim::Params p = box_params(Vec3d(0.4, 0.3, 0.4), 0.2 / 16);
  p.gravity = Vec3d::Zero();
  p.fluid.present = false;
  p.energy_ledger = true;
  sim::SolidDesc d = ball_desc({0.2, 0.12, 0.2}, kBallRadius);
  d.law = law;
  d.youngs_modulus = 2.0 * kShearModulus * (1.0 + ratio);
  d.poissons_ratio = ratio;
  d.velocity = {0, -2.28, 0};
  auto s = make_simulation(p, {d});
  const double start = s->diagnose_solid(0).kinetic_energy;
  double least = start, made = 0.0;
  std::uint64_t iterations = 0;
  while (s->state().time < 0.08 - 1e-9) {
    const auto info = s->step(std::min(1.0 / 96.0, 0.08 - s->state().time));
    CHECK(info.retries == 0);
    iterations += info.velocity_iterations;
    const double energy = info.energy->at_start.sum();  // velocity and place of one time, as HHT-alpha keeps them
    made = std::max(made, energy - least);
    least = std::min(least, energy);
  }
  const auto end = s->diagnose_solid(0);
  INFO("Poisson's ratio " << ratio << ": " << made / start << " of the energy made, " << iterations
                          << " iterations, up " << end.momentum[1] / end.mass);
  CHECK(made < 0.01 * start);
  CHECK(iterations < 500);
  CHECK(end.momentum[1] / end.mass > 1.4);
}

TEST_CASE("A spinning ball keeps its spin, and its energy does not grow", "[law]") {
  sim::Params p = still(Vec3d::Ones());
  p.domain_size = Vec3d::Constant(0.4);
  p.voxel_size = 0.02;
  sim::SolidDesc d = ball_desc(Vec3d::Constant(0.2), kBallRadius);
  d.angular_velocity = {0.0, 0.0, 10.0};
  auto s = make_simulation(p, {d});
  const auto first = s->diagnose_solid(0);
  for (int n = 0; n < 40; ++n) s->step(0.005);
  const auto last = s->diagnose_solid(0);
  INFO("kept " << last.angular_momentum[2] / first.angular_momentum[2]);
  CHECK(last.angular_momentum[2] > 0.95 * first.angular_momentum[2]);
  CHECK(last.angular_momentum[2] < 1.005 * first.angular_momentum[2]);
  CHECK(last.kinetic_energy + last.elastic_energy < 1.01 * first.kinetic_energy);
}

TEST_CASE("A stretched ball in vacuum swings at the frequency of Lamb's spheroidal mode", "[law]") {
  // omega R / c_s = 2.665622 for l = 2 of an incompressible sphere. Two sign changes of the same direction are a
  // period; 7 cells per radius leave 6 %. A free solid is nearly undamped: a period keeps 0.93 of the energy, 0.3 with
  // the shares of a solid in contact, 0.14 with backward Euler. u and v are half a step apart, by which the sum of
  // their energies wavers.
  constexpr double kRoot = 2.665622, kPi = 3.14159265358979323846;
  const double period = 2.0 * kPi * kBallRadius / (kRoot * std::sqrt(kShearModulus / 1000.0));
  sim::Params p = still_vacuum(Vec3d::Ones());
  auto s = ball_in_cube(p, 2.0 * kBallRadius, 14);
  const double e = 1.05;
  stretch(*s, Vec3d::Constant(0.2), {e, 1.0 / std::sqrt(e), 1.0 / std::sqrt(e)});
  const double start = s->diagnose_solid(0).elastic_energy;
  const double rest = elongation(s->solids()[0].surface.points);
  const auto longer = [&] { return elongation(s->state().solids[0].surface) - rest; };
  CHECK(longer() > 0.0);
  const std::vector<double> crossings = sign_changes(*s, period, 40.0, longer, [&] {
    const auto d = s->diagnose_solid(0);
    CHECK(d.kinetic_energy + d.elastic_energy < 1.1 * start);
  });
  REQUIRE(crossings.size() == 3);
  const auto end = s->diagnose_solid(0);
  const double kept = (end.kinetic_energy + end.elastic_energy) / start;
  INFO("period " << crossings[2] - crossings[0] << " s, exact " << period << " s, energy kept " << kept);
  CHECK(crossings[2] - crossings[0] == Approx(period).epsilon(0.07));
  CHECK(kept > 0.85);
}

TEST_CASE("A ball under a lasting load towards its centre is not compressed", "[law]") {
  // f = -beta (x - c) is the gradient of a pressure. Without the constraint the mean pressure beta R^2 / 5 would take
  // 10 % of the volume. The load is given as the velocity that it adds in a step.
  const double bulk = 5000.0 + 2.0 / 3.0 * kShearModulus, beta = 0.5 * bulk / (kBallRadius * kBallRadius), dt = 0.005;
  sim::Params p = still_vacuum(Vec3d::Ones());
  auto s = ball_in_cube(p, 2.0 * kBallRadius, 10, 1000.0, dt);  // damped: comes to rest
  load(*s, dt, 60,
       [&](const Vec3d& x, std::size_t a) { return -beta / 1000.0 * (x[static_cast<Eigen::Index>(a)] - 0.2); });
  const auto now = s->diagnose_solid(0);
  CHECK(now.min_det_f == Approx(1.0).margin(1e-4));
  CHECK(now.max_det_f == Approx(1.0).margin(1e-4));
  CHECK(now.volume_mesh == Approx(now.rest_volume).epsilon(0.005));
  CHECK(now.kinetic_energy < 1e-6);
}

TEST_CASE("A compressible ball under a load towards its centre shrinks by the mean pressure over K", "[law]") {
  const double bulk = 5000.0 + 2.0 / 3.0 * kShearModulus, dt = 0.005, strain = 0.01;
  const double beta = 5.0 * strain * bulk / (kBallRadius * kBallRadius);  // mean pressure beta R^2 / 5 = strain K
  sim::Params p = still_vacuum(Vec3d::Ones());
  p.domain_size = Vec3d::Constant(0.4);
  p.voxel_size = 0.0125;  // 16 cells across
  sim::SolidDesc d = ball_desc(Vec3d::Constant(0.2), kBallRadius);
  d.youngs_modulus = 70000.0 / 3.0;  // lambda 5000, mu 10000
  d.poissons_ratio = 1.0 / 6.0;
  d.compressible = true;
  d.rayleigh_beta = dt;                // comes to rest
  p.numerics.damping_by_pace = false;  // the load comes as a velocity, on which no stiffness may act
  auto s = make_simulation(p, {d});
  load(*s, dt, 60,
       [&](const Vec3d& x, std::size_t a) { return -beta / 1000.0 * (x[static_cast<Eigen::Index>(a)] - 0.2); });
  const auto now = s->diagnose_solid(0);
  CHECK(now.kinetic_energy < 1e-6);
  CHECK(1.0 - now.volume_mesh / now.rest_volume == Approx(strain).epsilon(0.05));
  CHECK(s->profile().tiles[static_cast<std::size_t>(sim::Stage::kPressureSolve)] == 0);
}

TEST_CASE("A compressible ball of Poisson's ratio 0.49 does not ring up after an impact", "[law]") {
  sim::Params p = still_vacuum({1.2, 1.14, 1.2}, 0.06);
  sim::SolidDesc d = ball_desc({0.6, 0.55, 0.57}, 0.31);
  d.density = 378.0;
  d.youngs_modulus = 2.7e5;
  d.poissons_ratio = 0.493;
  d.compressible = true;
  d.velocity = {0.3, -0.5, 0.0};
  d.angular_velocity = {0.0, 0.0, 3.0};
  const auto s = make_simulation(p, {d});
  const double start = s->diagnose_solid(0).kinetic_energy;
  double least = start, rise = 0.0;
  for (int step = 0; step < 170; ++step) {
    s->step(0.0047);
    const sim::SolidDiagnostics now = s->diagnose_solid(0);
    least = std::min(least, now.kinetic_energy + now.elastic_energy);
    rise = std::max(rise, now.kinetic_energy + now.elastic_energy - least);
  }
  INFO("largest rise of the energy " << rise / start << " of that at the start");
  CHECK(rise < 0.02 * start);
}

TEST_CASE("A compressible ball of half its size grows back in steps of a frame", "[law]") {
  const bool fluid = GENERATE(false, true);
  sim::Params p = still(Vec3d::Ones());
  p.fluid.present = fluid;
  p.fluid.density = 1.0;
  p.walls.face[3] = grid::Wall::kOpen;
  p.cfl_solid = 4.0;
  p.domain_size = Vec3d::Constant(0.4);
  p.voxel_size = 0.02;
  sim::SolidDesc d = ball_desc(Vec3d::Constant(0.2), kBallRadius);
  d.compressible = true;
  auto s = make_simulation(p, {d});
  stretch(*s, Vec3d::Constant(0.2), Vec3d::Constant(0.5));
  CHECK(s->diagnose_solid(0).volume_mesh == Approx(s->diagnose_solid(0).rest_volume / 8.0).epsilon(0.01));
  for (int frame = 0; frame < 24; ++frame) s->advance(1.0 / 24.0, {});
  const auto end = s->diagnose_solid(0);
  INFO("fluid " << fluid);
  CHECK(end.volume_mesh == Approx(end.rest_volume).epsilon(0.01));
  CHECK(end.elastic_energy < 1e-4);
}

TEST_CASE("A ball squashed to half its height grows back in steps of a frame where a side is open", "[law]") {
  sim::Params p = still(Vec3d::Ones());
  p.walls.face[3] = grid::Wall::kOpen;
  p.cfl_solid = 4.0;
  auto s = ball_in_cube(p, 2.0 * kBallRadius, 10);
  stretch(*s, Vec3d::Constant(0.2), {1.0, 0.5, 1.0});
  const auto squashed = s->diagnose_solid(0);
  CHECK(squashed.volume_mesh == Approx(0.5 * squashed.rest_volume).epsilon(0.01));
  for (int frame = 0; frame < 24; ++frame) s->advance(1.0 / 24.0, {});
  const auto end = s->diagnose_solid(0);
  const auto& rest = s->solids()[0].surface.points;
  const auto& surface = s->state().solids[0].surface;
  Vec3d shift = Vec3d::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) shift += (surface[i] - rest[i]) / static_cast<double>(rest.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < rest.size(); ++i) worst = std::max(worst, (surface[i] - rest[i] - shift).norm());
  INFO("farthest vertex " << worst << " m, energy " << end.elastic_energy << " of " << squashed.elastic_energy << " J");
  CHECK(worst < 1e-2 * 2.0 * kBallRadius);
  CHECK(end.volume_mesh == Approx(end.rest_volume).epsilon(0.01));
}

TEST_CASE("A ball that swings freely keeps its volume", "[law][nightly]") {
  sim::Params p = still_vacuum(Vec3d::Ones());
  auto s = ball_in_cube(p, 2.0 * kBallRadius, 10);
  const double along = 1.3, across = 1.0 / std::sqrt(along);
  stretch(*s, Vec3d::Constant(0.2), {along, across, across});
  double worst = 0.0;
  while (s->state().time < 0.4) {
    s->step(1.0 / 480.0);
    const auto now = s->diagnose_solid(0);
    worst = std::max(worst, std::abs(now.volume_mesh / now.rest_volume - 1.0));
  }
  INFO("volume off by " << worst);
  CHECK(worst < 0.0063);
}

TEST_CASE("A ball on the floor stays there and keeps its volume and its energy", "[law]") {
  sim::Params p = box_params({0.4, 0.36, 0.4});
  auto s = make_simulation(p, {ball_desc({0.2, kBallRadius, 0.2}, kBallRadius)});
  const double weight = s->diagnose_solid(0).mass * 9.8 * kBallRadius;
  const auto energy = [&](const sim::SolidDiagnostics& d) {
    return (d.kinetic_energy + d.elastic_energy) / weight + d.center[1] / kBallRadius;
  };
  for (int frame = 0; frame < 48; ++frame) s->advance(1.0 / 24.0, {});
  const auto start = s->diagnose_solid(0);
  CHECK(start.center[1] < 0.095);  // it sags
  CHECK(start.center[1] > 0.08);
  double creep = 0.0, highest = 0.0;
  Vec3d last = start.center;
  for (int frame = 0; frame < 12; ++frame) {
    s->advance(1.0 / 24.0, {});
    const auto now = s->diagnose_solid(0);
    creep = std::max(creep, (now.center - last).norm());
    last = now.center;
    highest = std::max(highest, energy(now) - energy(start));
    CHECK(now.volume_mesh == Approx(now.rest_volume).epsilon(0.01));
  }
  INFO("moves by " << creep / 0.02 << " cells in a frame, energy above the first " << highest << " m g R");
  CHECK(creep < 1e-3 * 0.02);
  CHECK(highest < 1e-5);
}

TEST_CASE("A heavy box that tumbles onto a no-slip floor leaves no divergence, in few iterations", "[law]") {
  sim::Params p = box_params({0.4, 0.4, 0.4});
  p.walls.face.fill(grid::Wall::kNoSlip);
  p.cfl_solid = 0.3;
  sim::SolidDesc d = ball_desc({0.2, 0.24, 0.2});
  d.surface = geometry::shapes::box({-0.1, -0.07, -0.06}, {0.1, 0.07, 0.06});
  const Mat3d turn = Eigen::AngleAxisd(0.6, Vec3d(1, 1, 1).normalized()).toRotationMatrix();
  for (Vec3d& x : d.surface.points) x = turn * x + Vec3d(0.2, 0.24, 0.2);
  d.velocity = {0.5, -2.0, 0.0};
  d.angular_velocity = {2.0, 0.0, 5.0};
  auto s = make_simulation(p, {d});
  std::uint64_t unconverged = 0, most = 0;
  double left = 0.0;
  while (s->state().time < 0.12 - 1e-9) {
    const auto info = s->step(1.0 / 480.0);
    unconverged += info.unconverged;
    most = std::max(most, info.pressure_iterations);
    left = std::max(left, info.divergence_after / info.divergence_before);
  }
  INFO(unconverged << " unconverged, most iterations " << most << ", divergence left " << left);
  CHECK(unconverged == 0);
  CHECK(most <= 30);
  CHECK(left < 0.02);
}

TEST_CASE("A ball that slides over the floor keeps its momentum along it and its turn about the vertical", "[law]") {
  sim::Params p = vacuum({0.6, 0.3, 0.5});
  sim::SolidDesc d = ball_desc({0.2, 0.1, 0.2}, kBallRadius);
  d.velocity = {0.5, 0.0, 0.2};
  d.angular_velocity = {0.0, 4.0, 0.0};
  auto s = make_simulation(p, {d});
  s->step(0.005);
  const auto start = s->diagnose_solid(0);
  for (int n = 0; n < 40; ++n) {
    s->step(0.005);
    const auto now = s->diagnose_solid(0);
    INFO("after " << n + 1 << " steps: " << now.momentum.transpose() << ", turn " << now.angular_momentum[1]);
    CHECK(now.momentum[0] == Approx(start.momentum[0]).epsilon(1e-4));
    CHECK(now.momentum[2] == Approx(start.momentum[2]).epsilon(1e-4));
    CHECK(now.angular_momentum[1] == Approx(start.angular_momentum[1]).epsilon(1e-3));
  }
  CHECK(s->diagnose_solid(0).center[0] > 0.28);
}

TEST_CASE("Smoke in a closed box keeps its amount over 100 frames, with a moving solid and with buoyancy", "[law]") {
  const auto [solid, buoyancy] = GENERATE(table<bool, bool>({{true, false}, {false, true}, {true, true}}));
  sim::Params p = box_params({0.6, 0.7, 0.6}, 0.04);
  p.fluid.vorticity_confinement = 1.5;
  if (buoyancy) p.fluid.temperature_buoyancy = 0.02;
  auto s =
      make_simulation(p, solid ? std::vector{ball_desc({0.3, 0.5, 0.3}, kBallRadius)} : std::vector<sim::SolidDesc>{});
  fluid::Emitter carpet;
  carpet.from_world.diagonal().head<3>() = Vec3d(1.0 / 1.2, 1.0 / 0.5, 1.0 / 1.2);
  carpet.density = 0.8;
  carpet.temperature = 100.0;
  s->add_emitter(carpet);
  s->prepare();
  const double smoke = s->diagnose_fluid().smoke;
  for (int frame = 0; frame < 100; ++frame) {
    s->advance(1.0 / 24.0, {});
    INFO("solid " << solid << ", buoyancy " << buoyancy << ", frame " << frame);
    REQUIRE(s->diagnose_fluid().smoke == Approx(smoke).epsilon(0.01));
    const auto& field = s->state().fluid.smoke;
    const auto [low, high] = std::minmax_element(field.begin(), field.end());
    REQUIRE((*low >= 0 && *high <= Real(0.8)));
  }
}
