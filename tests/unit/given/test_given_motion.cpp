// Purpose: pins and colliders: what is given arrives, holds, and pushes as it should.
#include <Eigen/Geometry>
#include <algorithm>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// Counter-clockwise seen from outside.
geometry::TriangleMesh box_mesh(const Vec3d& low, const Vec3d& high) {
  geometry::TriangleMesh mesh;
  for (int c = 0; c < 8; ++c)
    mesh.points.push_back({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
  constexpr int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return mesh;
}

// A bar that hangs from its upper end, which is held.
struct HangingBar {
  SimulationPtr s;
  std::size_t pin = 0;
  std::vector<std::uint8_t> held;
  explicit HangingBar(const sim::Params& p) : s(make_simulation(p)) {
    sim::SolidDesc bar = desc_of(box_mesh({0.15, 0.25, 0.15}, {0.25, 0.55, 0.25}));
    bar.youngs_modulus = 2e5;
    bar.rayleigh_alpha = 3.0;
    geometry::MeshReport report;
    s->add_solid(bar, report);
    for (const Vec3d& x : bar.surface.points) held.push_back(x[1] > 0.5);
    pin = s->add_pin(0, held);
  }
  double weight() { return 9.8 * s->diagnose_solid(0).mass; }
};

// Mean over the steps of a frame [N].
Vec3d force_in_frame(sim::Simulation& s, std::size_t pin, double length = kFrame) {
  Vec3d sum = Vec3d::Zero();
  s.advance(length, [&](double, const sim::StepInfo& last) {
    sum += last.pins[pin].impulse;
    return false;
  });
  return sum / length;
}

sim::Pose pose(const Vec3d& turn, const Vec3d& shift) { return {solid::rotation(turn), shift}; }

}  // namespace

TEST_CASE("What holds a bar that hangs is its weight, and its held end does not move", "[law]") {
  for (const bool fluid : {false, true}) {
    sim::Params p = box_params({0.4, 0.6, 0.4}, kCell);
    p.fluid.present = fluid;
    HangingBar bar(p);
    Vec3d force;
    for (int frame = 0; frame < 24; ++frame) force = force_in_frame(*bar.s, bar.pin);
    double moved = 0.0;
    for (std::size_t v = 0; v < bar.held.size(); ++v)
      if (bar.held[v])
        moved = std::max(moved, (bar.s->state().solids[0].surface[v] - bar.s->solids()[0].surface.points[v]).norm());
    INFO("force " << force.transpose() << " N, weight " << bar.weight() << " N, moved by " << moved / kCell << " h");
    CHECK(std::abs(force[1] / bar.weight() - 1.0) < 0.01);
    CHECK(std::abs(force[0]) + std::abs(force[2]) < 1e-3 * bar.weight());
    CHECK(moved <= 1e-6 * kCell);
    CHECK(bar.s->diagnose_solid(0).extent_min[1] < 0.2499);  // it hangs
  }
}

// Sag of a bar four times as long as it is high, clamped at one end, over that of Timoshenko's beam: a clamp that holds
// the sides as well stiffens it. Linear elasticity in three dimensions, tests/reference/clamped_bar.py.
constexpr double kClampedIncompressible = 0.939, kClamped = 0.980;  // Poisson's ratio 1/2, 0.3

TEST_CASE("A cantilever sags as a clamped bar does", "[law]") {
  constexpr double kHigh = 0.1, kLong = 0.4, kShear = 1e6 / 2.6, kDensity = 1000.0;
  sim::Params p = vacuum({0.7, 0.4, 0.3}, kHigh / 8.0);
  sim::SolidDesc bar = desc_of(box_mesh({0.05, 0.2, 0.1}, {0.15 + kLong, 0.3, 0.2}));
  bar.youngs_modulus = 2.6 * kShear;
  bar.poissons_ratio = 0.3;
  bar.rayleigh_alpha = 8.0;
  const auto s = make_simulation(p, {bar});
  const geometry::TriangleMesh clamp = box_mesh({0.0, 0.15, 0.05}, {0.15, 0.35, 0.25});
  s->add_pin(0, geometry::examine(clamp, sim::kRestSpacing * p.voxel_size)->distance);
  for (int frame = 0; frame < 24; ++frame) s->advance(kFrame, {});
  double sag = 0.0;  // of the four corners of the free end
  for (const std::size_t v : {1, 3, 5, 7})
    sag += 0.25 * (bar.surface.points[v][1] - s->state().solids[0].surface[v][1]);
  // The pressure keeps the volume: Young's modulus is three times the shear modulus.
  const double bend = 1.5 * kDensity * 9.8 * std::pow(kLong, 4) / (3.0 * kShear * kHigh * kHigh);
  constexpr double kSection =
      10.0 * 1.5 / (12.0 + 11.0 * 0.5);  // shear coefficient, Cowper (1966), Poisson's ratio 1/2
  const double beam = bend + kDensity * 9.8 * kLong * kLong / (2.0 * kSection * kShear);
  const double wanted = kClampedIncompressible * beam;
  INFO("sag " << sag << " m, of the bar " << wanted << ", of Timoshenko's beam " << beam);
  CHECK(sag == Approx(wanted).epsilon(0.02));
}

TEST_CASE("A compressible bar that is pinned comes to rest in steps of a frame", "[law]") {
  sim::Params p = vacuum({0.7, 0.4, 0.3}, 0.0125);
  sim::SolidDesc bar = desc_of(box_mesh({0.05, 0.2, 0.1}, {0.55, 0.3, 0.2}));
  bar.youngs_modulus = 1e6;
  bar.poissons_ratio = 0.3;
  bar.rayleigh_alpha = 8.0;
  bar.compressible = true;
  const auto s = make_simulation(p, {bar});
  const geometry::TriangleMesh clamp = box_mesh({0.0, 0.15, 0.05}, {0.15, 0.35, 0.25});
  s->add_pin(0, geometry::examine(clamp, sim::kRestSpacing * p.voxel_size)->distance);
  for (int frame = 0; frame < 16; ++frame) CHECK(s->advance(kFrame, {}).steps == 1);
  double sag = 0.0;  // of the four corners of the free end
  for (const std::size_t v : {1, 3, 5, 7})
    sag += 0.25 * (bar.surface.points[v][1] - s->state().solids[0].surface[v][1]);
  const double bend = 1.5 * 1000.0 * 9.8 * std::pow(0.4, 4) / (1e6 * 0.01);
  const double section = 10.0 * 1.3 / (12.0 + 11.0 * 0.3);
  const double wanted = kClamped * (bend + 9800.0 * 0.16 / (2.0 * section * 1e6 / 2.6));
  INFO("sag " << sag << " m, of the bar " << wanted);
  CHECK(sag == Approx(wanted).epsilon(0.02));
  const sim::SolidDiagnostics lies = s->diagnose_solid(0);
  CHECK(lies.kinetic_energy < 1e-3 * lies.elastic_energy);
  // What holds it answers the torque of its weight, and does no work.
  const sim::PinReaction held = s->last_step().pins[0];
  const Vec3d torque = -(lies.center - held.center).cross(9.8 * lies.mass * kFrame * -Vec3d::UnitY());
  INFO("torque " << held.angular_impulse.transpose() << ", of the weight " << torque.transpose());
  CHECK((held.angular_impulse - torque).norm() < 0.01 * torque.norm());
  CHECK(held.work == 0.0);
}

TEST_CASE("What turns as given takes its angular momentum and twice its energy from what holds it", "[law]") {
  sim::Params p = vacuum({0.6, 0.6, 0.6}, kCell);
  p.gravity.setZero();
  const auto s = make_simulation(p, {desc_of(box_mesh({0.2, 0.22, 0.24}, {0.4, 0.38, 0.36}))});
  const geometry::TriangleMesh around = box_mesh({0.1, 0.1, 0.1}, {0.5, 0.5, 0.5});
  s->add_pin(0, geometry::examine(around, sim::kRestSpacing * p.voxel_size)->distance);
  s->set_motion(0, 0.0, kFrame, {},
                {solid::rotation({0.0, 0.0, 0.02}),
                 s->pins()[0].motion.center - solid::rotation({0.0, 0.0, 0.02}) * s->pins()[0].motion.center});
  s->step(kFrame);
  const sim::PinReaction held = s->last_step().pins[0];
  const sim::SolidDiagnostics turns = s->diagnose_solid(0);
  INFO("angular impulse " << held.angular_impulse.transpose() << ", work " << held.work);
  CHECK((held.angular_impulse - turns.angular_momentum).norm() < 1e-3 * turns.angular_momentum.norm());
  // The force acts as long as the step, all of which the solid has its new velocity.
  CHECK(held.work == Approx(2.0 * turns.kinetic_energy).epsilon(0.01));
}

TEST_CASE("A bar gives way by as much as is free of it, wherever between nodes the pin ends", "[law]") {
  constexpr double kModulus = 4e5, kDensity = 1000.0, kLow = 0.24, kHigh = 0.56;
  for (const double into : {0.1, 0.3, 0.5, 0.7, 0.9}) {  // of a cell from a plane of nodes to where the pin ends
    sim::SolidDesc bar = desc_of(box_mesh({0.16, kLow, 0.16}, {0.26, kHigh, 0.26}));
    bar.youngs_modulus = kModulus;
    bar.poissons_ratio = 0.0;
    bar.compressible = true;
    bar.rayleigh_alpha = 10.0;
    const auto s = make_simulation(vacuum({0.4, 0.6, 0.4}, kCell), {bar});
    const double border = (20.0 + into) * kCell, length = border - kLow;
    const geometry::TriangleMesh clamp = box_mesh({0.0, border, 0.0}, {0.4, kHigh + 0.1, 0.4});
    s->add_pin(0, geometry::examine(clamp, sim::kRestSpacing * kCell)->distance);
    for (int frame = 0; frame < 24; ++frame) s->advance(kFrame, {});
    double longer = 0.0;  // by the four corners of the lower end
    for (const std::size_t v : {0, 1, 4, 5}) longer += 0.25 * (kLow - s->state().solids[0].surface[v][1]);
    const double wanted = kDensity * 9.8 * length * length / (2.0 * kModulus);
    INFO("pin ends " << into << " into a cell: longer by " << longer << ", wanted " << wanted);
    CHECK(longer == Approx(wanted).epsilon(0.01));
  }
}

TEST_CASE("A pin that turns and goes takes its end where the pose says") {
  HangingBar bar(vacuum({0.6, 0.7, 0.6}, kCell));
  const Vec3d turn(0.0, 0.9, 0.3), shift(0.1, 0.0, 0.12);
  const auto part = [&](double s) { return pose(s * turn, s * shift); };
  for (int frame = 0; frame < 12; ++frame) {
    bar.s->set_motion(bar.pin, frame * kFrame, (frame + 1) * kFrame, part(frame / 12.0), part((frame + 1) / 12.0));
    bar.s->advance(kFrame, {});
  }
  double off = 0.0, far = 0.0;
  for (std::size_t v = 0; v < bar.held.size(); ++v) {
    const Vec3d x = bar.s->state().solids[0].surface[v];
    const Vec3d wanted = part(1.0).place(bar.s->solids()[0].surface.points[v]);
    (bar.held[v] ? off : far) = std::max(bar.held[v] ? off : far, (x - wanted).norm() / kCell);
  }
  CHECK(off < 1e-6);
  CHECK(far < 6.0);  // the rest of it follows
  CHECK(bar.s->diagnose_solid(0).min_det_f > 0.5);
}

TEST_CASE("A collider is where its pose says and leaves the fluid without sources", "[law]") {
  sim::Params p = box_params({0.6, 0.6, 0.6}, kCell);
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  const std::size_t pin = s->add_collider(desc_of(ball_mesh({0.25, 0.3, 0.3}, 0.1)), report);
  const Vec3d center(0.25, 0.3, 0.3);
  const auto at = [&](double x) {
    const Vec3d turn(0.0, 0.2 * x / 0.02, 0.0);
    return pose(turn, center + Vec3d(x, 0.0, 0.0) - solid::rotation(turn) * center);
  };
  for (int frame = 0; frame < 5; ++frame) {
    s->set_motion(pin, frame * kFrame, (frame + 1) * kFrame, at(0.02 * frame), at(0.02 * (frame + 1)));
    const sim::StepInfo info = s->advance(kFrame, {});
    CHECK(info.unconverged == 0);
    CHECK(info.divergence_after < 0.02 * info.divergence_before);
  }
  double off = 0.0;
  for (std::size_t v = 0; v < s->state().solids[0].surface.size(); ++v)
    off = std::max(off, (s->state().solids[0].surface[v] - at(0.1).place(s->solids()[0].surface.points[v])).norm());
  CHECK(off < 1e-9);
  CHECK(all_finite(s->state()));
}

TEST_CASE("A ball that is set in motion takes half its volume of fluid along", "[law]") {
  sim::Params p = still({0.6, 0.6, 0.6}, 0.0125);
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  const std::size_t pin = s->add_collider(desc_of(ball_mesh({0.3, 0.3, 0.3}, 0.1)), report);
  s->set_motion(pin, 0.0, 1e-3, {}, pose(Vec3d::Zero(), {1e-4, 0.0, 0.0}));
  s->step(1e-3);
  // The box brings that to 1 + 3 (r / R)^3 times as much, R the radius of a ball of its volume.
  const double volume = report.solid_volume, radius = 0.6 / std::cbrt(4.0 * 3.14159265358979 / 3.0);
  const double wanted = 0.5 * p.fluid.density * volume * 0.1 * (1.0 + 3.0 * std::pow(0.1 / radius, 3));
  const Vec3d impulse = s->last_step().pins[pin].impulse;
  INFO("impulse " << impulse[0] << ", of added mass " << wanted);
  CHECK(impulse[0] / wanted == Approx(1.0).margin(0.1));
}

TEST_CASE("Nothing falls through a collider, and it gives a ball the momentum that it counts", "[law][slow]") {
  const auto s = make_simulation(vacuum({0.6, 0.7, 0.6}, kCell), {ball_desc({0.3, 0.35, 0.3}, 0.08)});
  geometry::MeshReport report;
  // It reaches through three walls and comes up to meet the ball.
  const std::size_t pin = s->add_collider(desc_of(box_mesh({0.05, -0.1, -0.1}, {0.7, 0.16, 0.5})), report);
  double least = 1e30, impulse = 0.0;
  for (int frame = 0; frame < 24; ++frame) {
    const auto at = [](int f) { return pose(Vec3d::Zero(), {0.0, 0.01 * std::min(f, 8), 0.0}); };
    s->set_motion(pin, frame * kFrame, (frame + 1) * kFrame, at(frame), at(frame + 1));
    s->advance(kFrame, [&](double, const sim::StepInfo& last) {
      impulse += last.pins[pin].impulse[1];
      const double top = s->state().solids[1].surface[7][1];
      for (const Vec3d& x : s->state().solids[0].surface) least = std::min(least, (x[1] - top) / kCell);
      return false;
    });
  }
  const sim::SolidDiagnostics ball = s->diagnose_solid(0);
  const double wanted = ball.momentum[1] + ball.mass * 9.8 * s->state().time;
  INFO("least gap " << least << " h, impulse " << impulse << ", momentum and weight " << wanted);
  CHECK(least > -0.5);
  CHECK(least < 0.75);
  CHECK(impulse == Approx(wanted).epsilon(0.01));
  CHECK(ball.center[1] > 0.3);
}

TEST_CASE("A body slides down a tilted collider as Coulomb says", "[law]") {
  const double tilt = 0.35, mu = 0.2;
  sim::Params p = vacuum({0.9, 0.6, 0.4}, kCell);
  const Mat3d turn = solid::rotation({0.0, 0.0, -tilt});  // downhill along x
  const Vec3d pivot(0.45, 0.1, 0.2);
  const auto tilted = [&](geometry::TriangleMesh mesh) {
    for (Vec3d& x : mesh.points) x = pivot + turn * (x - pivot);
    return mesh;
  };
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  sim::SolidDesc plane = desc_of(tilted(box_mesh({-0.1, 0.0, -0.1}, {1.1, 0.2, 0.5})));
  plane.friction = mu;
  s->add_collider(plane, report);
  sim::SolidDesc body =
      desc_of(tilted(box_mesh({0.15, 0.2 + 1.7 * kCell, 0.12}, {0.31, 0.2 + 1.7 * kCell + 0.08, 0.28})));
  body.friction = mu;
  body.youngs_modulus = 2e5;
  s->add_solid(body, report);
  const Vec3d downhill = turn.col(0);
  const auto speed = [&] {
    const sim::SolidDiagnostics d = s->diagnose_solid(1);
    return d.momentum.dot(downhill) / d.mass;
  };
  for (int frame = 0; frame < 4; ++frame) s->advance(kFrame, {});
  const double first = speed(), begin = s->state().time;
  for (int frame = 0; frame < 10; ++frame) s->advance(kFrame, {});
  const double found = (speed() - first) / (s->state().time - begin);
  const double wanted = 9.8 * (std::sin(tilt) - mu * std::cos(tilt));
  INFO("acceleration " << found << " m/s^2, Coulomb's " << wanted);
  CHECK(found == Approx(wanted).epsilon(0.02));
}

// In the gap beside where they touch there are cells of the fluid all of whose corners are given.
TEST_CASE("Wind past colliders that touch each other, and past a pinned foot on a collider", "[law]") {
  for (const double gap : {-0.25, 0.0, 0.5}) {  // cells between them
    for (const bool pinned : {false, true}) {
      sim::Params p = box_params({0.8, 0.5, 0.3}, kCell);
      p.walls.velocity[0] = {1, 0, 0};
      p.walls.face[1] = grid::Wall::kOpen;
      const auto s = make_simulation(p);
      geometry::MeshReport report;
      const double ground = 0.05;
      s->add_collider(desc_of(box_mesh({0.2, -0.1, -0.1}, {0.6, ground, 0.4})), report);
      const sim::SolidDesc ball = ball_desc({0.4, ground + 0.06 + gap * kCell, 0.15}, 0.06);
      if (pinned) {
        s->add_solid(ball, report);
        s->add_pin(1, std::vector<std::uint8_t>(ball.surface.points.size(), 1));
      } else {
        s->add_collider(ball, report);
      }
      for (int frame = 0; frame < 4; ++frame) {
        const sim::StepInfo info = s->advance(kFrame, {});
        INFO("gap " << gap << " h, pinned " << pinned << ", frame " << frame + 1 << ": " << info.steps << " steps, "
                    << info.pressure_iterations << " iterations, fluid " << info.max_speed_fluid << " m/s");
        CHECK(info.unconverged == 0);
        CHECK(info.pressure_iterations <= 15 * info.steps);
        CHECK(info.max_speed_fluid < 6.0);
      }
    }
  }
}

// A piston as wide as a box with an open top leaves its floor, or comes down on a cup, and what is below it is shut
// off.
TEST_CASE("Fluid that colliders shut in or let in is spread over its pocket, and nothing bursts", "[law]") {
  for (const bool cup : {false, true}) {
    sim::Params p = box_params({0.4, 0.5, 0.4}, kCell);
    p.walls.face[3] = grid::Wall::kOpen;
    const auto s = make_simulation(p);
    geometry::MeshReport report;
    const double low = cup ? 0.3 : 0.02, speed = cup ? -0.3 : 0.3;
    if (cup) {
      s->add_collider(desc_of(box_mesh({0.1, -0.1, 0.1}, {0.3, 0.05, 0.3})), report);
      for (const auto& [x0, x1, z0, z1] : {std::array{0.1, 0.15, 0.1, 0.3}, std::array{0.25, 0.3, 0.1, 0.3},
                                           std::array{0.15, 0.25, 0.1, 0.15}, std::array{0.15, 0.25, 0.25, 0.3}})
        s->add_collider(desc_of(box_mesh({x0, 0.05, z0}, {x1, 0.25, z1})), report);
    }
    const Vec3d inner = cup ? Vec3d(0.08, low, 0.08) : Vec3d(-0.05, low, -0.05);
    const std::size_t lid =
        s->add_collider(desc_of(box_mesh(inner, {0.4 - inner[0], low + 0.08, 0.4 - inner[2]})), report);
    for (int frame = 0; frame < 6; ++frame) {
      const auto at = [&](int f) {
        return sim::Pose{Mat3d::Identity(), {0, std::max(speed * f * kFrame, cup ? -0.06 : -1.0), 0}};
      };
      s->set_motion(lid, frame * kFrame, (frame + 1) * kFrame, at(frame), at(frame + 1));
      const sim::StepInfo info = s->advance(kFrame, {});
      INFO((cup ? "cup" : "piston") << ", frame " << frame + 1 << ": " << info.steps << " steps, "
                                    << info.pressure_iterations << " iterations, fluid " << info.max_speed_fluid);
      CHECK(info.unconverged == 0);
      CHECK(info.max_speed_fluid < 3.0);
    }
  }
}

TEST_CASE("A region that holds nothing, and a collider that is pinned, are refused") {
  HangingBar bar(vacuum({0.6, 0.7, 0.6}, kCell));
  std::vector<std::uint8_t> none(bar.held.size(), 0);
  CHECK_THROWS_WITH(bar.s->add_pin(0, none),
                    Catch::Contains("pin 2 of solid 1: the region holds 0 nodes of the solid"));
  const auto away = geometry::examine(ball_mesh({0.5, 0.1, 0.5}, 0.05), sim::kRestSpacing * kCell);
  CHECK_THROWS_WITH(bar.s->add_pin(0, away->distance), Catch::Contains("must be at least 1"));
  geometry::MeshReport report;
  bar.s->add_collider(desc_of(ball_mesh({0.5, 0.1, 0.5}, 0.05)), report);
  CHECK_THROWS_WITH(bar.s->add_pin(1, away->distance), Catch::Contains("that is a collider"));
  CHECK_THROWS_WITH(bar.s->add_solid(ball_desc({0.5, 0.12, 0.5}, 0.05), report), Catch::Contains("overlaps solid 2"));
}

TEST_CASE("More solids than a byte can name are refused, colliders included") {
  const auto s = make_simulation(vacuum({0.6, 0.6, 0.6}, 0.05));
  geometry::MeshReport report;
  sim::SolidDesc ball = ball_desc({0.3, 0.3, 0.3}, 0.1);
  ball.examined = geometry::examine(ball.surface, sim::kRestSpacing * 0.05);
  for (int n = 0; n < 255; ++n) s->add_collider(ball, report);
  CHECK_THROWS_WITH(s->add_collider(ball, report), Catch::Contains("solid 256: must be at most 255"));
}
