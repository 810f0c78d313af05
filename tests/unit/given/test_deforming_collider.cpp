// Purpose: colliders whose points are given: they move as such whose transform is, push aside what they take up, and
// lift what lies on them, and rub it.
#include <algorithm>

#include "base/error.hpp"
#include "contact/solid_contact.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

sim::Pose pose_about(const Vec3d& center, const Vec3d& turn, const Vec3d& shift) {
  return {solid::rotation(turn), center + shift - solid::rotation(turn) * center};
}

std::vector<Vec3d> placed(const sim::Pose& pose, std::vector<Vec3d> points) {
  for (Vec3d& x : points) x = pose.place(x);
  return points;
}

// Out through the face x = its upper end [m^3/s].
double flux_out(sim::Simulation& s) {
  const grid::Grid& g = s.grid();
  double sum = 0.0;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (const int b : {0, 1})
        for (const int c : {0, 1})
          sum += 0.25 * g.h * g.h * static_cast<double>(s.fluid_velocity().at(g.node(g.cells[0], j + b, k + c))[0]);
  return sum;
}

struct Moved {
  grid::VectorField fluid;
  Vec3d momentum, impulse, angular;
  double work;
};

// What the points of the ball do, the rest is done by its pose.
enum class Share { kNone, kTurn, kAll };

// A ball in a fluid that goes and turns, with one that is free at a distance ahead of it.
Moved move_ball(sim::Preset preset, Share share, double distance) {
  sim::Params p = still({0.7, 0.4, 0.4}, kCell);
  p.fluid.density = 100.0;
  p.numerics = sim::numerics_of(preset);
  p.max_time_step = kFrame / 12.0;  // shorter than all that the speeds ask for: the same steps in all runs
  sim::SolidDesc free = ball_desc({0.42 + distance, 0.2, 0.2}, 0.08);
  free.contact_stiffness = 1e4;
  const auto s = make_simulation(p, {free});
  geometry::MeshReport report;
  const Vec3d center(0.243, 0.207, 0.196);
  const geometry::TriangleMesh ball = ball_mesh(center, 0.1, 24);
  const std::size_t pin = s->add_collider(desc_of(ball), report);
  const auto motion = [&](int f, bool turns, bool goes) {
    return pose_about(center, Vec3d(0.0, 0.0, turns ? 0.02 * f : 0.0), Vec3d(goes ? 0.02 * f : 0.0, 0.0, 0.0));
  };
  Moved moved;
  moved.impulse = moved.angular = Vec3d::Zero();
  moved.work = 0.0;
  for (int f = 0; f < 4; ++f) {
    const double start = f * kFrame, end = (f + 1) * kFrame;
    const auto pose = [&](int at) { return motion(at, share == Share::kNone, share != Share::kAll); };
    const auto points = [&](int at) { return placed(motion(at, true, share == Share::kAll), ball.points); };
    s->set_motion(pin, start, end, pose(f), pose(f + 1));
    if (share != Share::kNone) s->set_points(pin, {start, end, points(f), points(f + 1)});
    s->advance(kFrame, [&](double, const sim::StepInfo& last) {
      moved.impulse += last.pins[pin].impulse;
      moved.angular += last.pins[pin].angular_impulse + (last.pins[pin].center - center).cross(last.pins[pin].impulse);
      moved.work += last.pins[pin].work;
      return false;
    });
  }
  moved.fluid = s->fluid_velocity();
  moved.momentum = s->diagnose_solid(0).momentum;
  return moved;
}

// Root of the sum of the squares of a field, less another one.
double size_of(const grid::VectorField& one, const grid::VectorField* other = nullptr) {
  double sum = 0.0;
  for (std::size_t n = 0; n < one.size(); ++n)
    sum += (one.at(n) - (other ? other->at(n) : Vec3(Vec3::Zero()))).cast<double>().squaredNorm();
  return std::sqrt(sum);
}

}  // namespace

TEST_CASE("A ball whose points move is one whose transform does", "[law][nightly]") {
  for (const sim::Preset preset : {sim::Preset::kProduction, sim::Preset::kPaper2016})
    for (const double distance : {0.09, 0.04}) {  // in the first the balls do not meet
      const Moved pose = move_ball(preset, Share::kNone, distance);
      for (const Share share : {Share::kAll, Share::kTurn}) {
        const Moved points = move_ball(preset, share, distance);
        const double off = size_of(points.fluid, &pose.fluid) / size_of(pose.fluid);
        INFO("preset " << static_cast<int>(preset) << ", " << distance << " m, share " << static_cast<int>(share)
                       << ": fluid off by " << off << ", momentum " << points.momentum.transpose() << " for "
                       << pose.momentum.transpose() << ", impulse " << points.impulse.transpose() << " for "
                       << pose.impulse.transpose() << ", work " << points.work << " for " << pose.work);
        CHECK(pose.momentum[0] > (distance < 0.05 ? 0.9 : 0.005));  // through a film of a cell: 0.008
        // Turning the mesh by 0.05 rad alone changes 0.04 in the wake of the ball. Where balls have met a shift of it
        // by 1e-5 m changes 0.13 of the flow and 0.008 of the impulse, one by 1e-3 m 0.17 and 0.007.
        const bool met = distance < 0.05;
        CHECK(off < (met ? 0.2 : 0.05));
        CHECK((points.momentum - pose.momentum).norm() < 0.02 * pose.momentum.norm());
        CHECK((points.impulse - pose.impulse).norm() < (met ? 0.02 : 0.01) * pose.impulse.norm());
        CHECK(points.work == Approx(pose.work).epsilon(met ? 0.02 : 0.01));
      }
    }
}

TEST_CASE("A ball that grows pushes its volume out of an open side", "[law]") {
  for (const sim::Preset preset : {sim::Preset::kProduction, sim::Preset::kPaper2016}) {
    sim::Params p = still({0.6, 0.4, 0.4}, kCell);
    p.numerics = sim::numerics_of(preset);
    p.walls.face[1] = grid::Wall::kOpen;
    const auto s = make_simulation(p);
    geometry::MeshReport report;
    const Vec3d center(0.213, 0.207, 0.191);
    const geometry::TriangleMesh ball = ball_mesh(center, 0.08, 24);
    const std::size_t pin = s->add_collider(desc_of(ball), report);
    const auto grown = [&](int f) {
      std::vector<Vec3d> points = ball.points;
      for (Vec3d& x : points) x = center + (1.0 + 0.04 * f) * (x - center);
      return points;
    };
    double out = 0.0;
    for (int f = 0; f < 8; ++f) {
      s->set_points(pin, {f * kFrame, (f + 1) * kFrame, grown(f), grown(f + 1)});
      const double before = geometry::signed_volume(grown(f), ball.triangles);
      double sum = 0.0;
      s->advance(kFrame, [&](double, const sim::StepInfo& last) {
        sum += last.dt * flux_out(*s);
        return false;
      });
      const double wanted = geometry::signed_volume(grown(f + 1), ball.triangles) - before;
      INFO("frame " << f << ": out " << sum << " m^3, grown by " << wanted);
      CHECK(sum / wanted == Approx(1.0).margin(0.02));
      out += sum;
    }
    const double all =
        geometry::signed_volume(grown(8), ball.triangles) - geometry::signed_volume(ball.points, ball.triangles);
    INFO("out " << out << " m^3, grown by " << all);
    CHECK(out / all == Approx(1.0).margin(0.01));
  }
}

namespace {

// A plate with n x n squares on top and below, whose top is y = high[1] + rise (1 - r^2)^2, r over `radius` from its
// middle.
geometry::TriangleMesh plate_mesh(const Vec3d& low, const Vec3d& high, int n, double rise, double radius) {
  geometry::TriangleMesh mesh;
  const Vec3d middle = 0.5 * (low + high);
  for (const bool top : {false, true})
    for (int k = 0; k <= n; ++k)
      for (int i = 0; i <= n; ++i) {
        Vec3d x(low[0] + (high[0] - low[0]) * i / n, top ? high[1] : low[1], low[2] + (high[2] - low[2]) * k / n);
        const double r = std::hypot(x[0] - middle[0], x[2] - middle[2]) / radius;
        if (top && r < 1.0) x[1] += rise * std::pow(1.0 - r * r, 2);
        mesh.points.push_back(x);
      }
  const auto at = [&](int i, int k, bool top) { return (top ? (n + 1) * (n + 1) : 0) + (n + 1) * k + i; };
  const auto square = [&](int a, int b, int c, int d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < n; ++i) {
      square(at(i, k, true), at(i, k + 1, true), at(i + 1, k + 1, true), at(i + 1, k, true));
      square(at(i, k, false), at(i + 1, k, false), at(i + 1, k + 1, false), at(i, k + 1, false));
    }
  for (int i = 0; i < n; ++i) {
    square(at(i, 0, false), at(i, 0, true), at(i + 1, 0, true), at(i + 1, 0, false));
    square(at(i + 1, n, false), at(i + 1, n, true), at(i, n, true), at(i, n, false));
    square(at(0, i + 1, false), at(0, i + 1, true), at(0, i, true), at(0, i, false));
    square(at(n, i, false), at(n, i, true), at(n, i + 1, true), at(n, i + 1, false));
  }
  return mesh;
}

// How deep the vertices of one closed mesh are in another one [m].
double depth(const std::vector<Vec3d>& points, const geometry::TriangleMesh& mesh) {
  const auto surface = geometry::examine(mesh, sim::kRestSpacing * kCell);
  double least = 1e30;
  for (const Vec3d& x : points) least = std::min(least, surface->distance.sample(x));
  return -least;
}

}  // namespace

TEST_CASE("A plate that bulges under a block lifts it, and counts what it gives it", "[law][nightly]") {
  for (const sim::Preset preset : {sim::Preset::kProduction, sim::Preset::kPaper2016}) {
    sim::Params p = vacuum({0.6, 0.6, 0.6}, kCell);
    p.numerics = sim::numerics_of(preset);
    const auto s = make_simulation(p);
    geometry::MeshReport report;
    const auto plate = [](double rise) { return plate_mesh({0.05, 0.06, 0.05}, {0.55, 0.2, 0.55}, 32, rise, 0.22); };
    const auto rise = [](int f) { return 0.005 * std::clamp(f - 2, 0, 12); };
    sim::SolidDesc bulging = desc_of(plate(0.0));
    bulging.friction = 0.5;
    bulging.contact_stiffness = 2e4;
    const std::size_t pin = s->add_collider(bulging, report);
    const geometry::TriangleMesh cube = plate_mesh({0.22, 0.21, 0.22}, {0.38, 0.35, 0.38}, 8, 0.0, 1.0);
    sim::SolidDesc body = desc_of(cube);
    body.youngs_modulus = 2e5;
    body.rayleigh_alpha = 4.0;
    body.friction = 0.5;
    body.contact_stiffness = 2e4;
    s->add_solid(body, report);
    double impulse = 0.0, moving = -1e30, resting = -1e30, first = 0.0;
    const double start = s->diagnose_solid(1).center[1];
    for (int f = 0; f < 30; ++f) {
      s->set_points(pin, {f * kFrame, (f + 1) * kFrame, plate(rise(f)).points, plate(rise(f + 1)).points});
      s->advance(kFrame, [&](double, const sim::StepInfo& last) {
        impulse += last.pins[pin].impulse[1];
        return false;
      });
      const auto &below = s->state().solids[0].surface, &above = s->state().solids[1].surface;
      const double deep = std::max(depth(above, plate(rise(f + 1))), depth(below, {above, cube.triangles})) / kCell;
      (f < 24 ? moving : resting) = std::max(f < 24 ? moving : resting, deep);
      if (f == 1) first = s->diagnose_solid(1).center[1];  // before the plate moves
    }
    const sim::SolidDiagnostics block = s->diagnose_solid(1);
    const double drag = block.mass * body.rayleigh_alpha * (block.center[1] - start);
    const double wanted = block.momentum[1] + block.mass * 9.8 * s->state().time + drag;
    INFO("preset " << static_cast<int>(preset) << ": lifted by " << block.center[1] - first << " m, depth in motion "
                   << moving << " h, at rest " << resting << " h, impulse " << impulse << " for " << wanted);
    CHECK(block.center[1] - first == Approx(0.06).margin(0.3 * kCell));
    CHECK(moving < 0.5);
    CHECK(resting < 0.25);
    // Particles of the other preset give a collider what no node of it holds (contact record).
    if (preset == sim::Preset::kProduction) CHECK(impulse == Approx(wanted).epsilon(0.003));
  }
}

namespace {

constexpr double kFriction = 0.3;
constexpr double kShort = 1.0 / 96.0;  // what a motion that speeds up is given for at a time [s]
constexpr int kStart = 40;             // of these the block has come to rest, and the motion begins

// A block in vacuum on a collider whose upper face is at y = 0.2, over x = `left`.
struct Carried {
  SimulationPtr s;
  std::size_t pin = 0;

  Carried(const geometry::TriangleMesh& collider, double left) {
    sim::Params p = vacuum({0.9, 0.5, 0.4}, kCell);
    s = make_simulation(p);
    geometry::MeshReport report;
    sim::SolidDesc below = desc_of(collider),
                   block = desc_of(plate_mesh({left, 0.2 + sim::kContactSkin * kCell, 0.12},
                                              {left + 0.16, 0.28 + sim::kContactSkin * kCell, 0.28}, 8, 0.0, 1.0));
    below.friction = block.friction = kFriction;
    block.youngs_modulus = 2e5;
    block.poissons_ratio = 0.2;
    block.rayleigh_beta = 2e-3;
    pin = s->add_collider(below, report);
    s->add_solid(block, report);
  }

  double speed() {
    const sim::SolidDiagnostics block = s->diagnose_solid(1);
    return block.momentum[0] / block.mass;
  }
};

// The speed that a block gains from 8 to 32 times kShort after the start, and what it has then, on a plate that goes
// off along x with an acceleration.
std::pair<double, double> carry(double acceleration, bool by_points) {
  const geometry::TriangleMesh plate = plate_mesh({-0.5, 0.08, -0.1}, {1.1, 0.2, 0.5}, 16, 0.0, 1.0);
  Carried scene(plate, 0.2);
  double early = 0.0;
  for (int n = -kStart; n < 32; ++n) {
    const auto pose = [&](int at) {
      const double time = kShort * std::max(0, at);
      return pose_about({0, 0, 0}, {0, 0, 0}, {0.5 * acceleration * time * time, 0.0, 0.0});
    };
    const double start = (kStart + n) * kShort, end = start + kShort;
    if (by_points)
      scene.s->set_points(scene.pin, {start, end, placed(pose(n), plate.points), placed(pose(n + 1), plate.points)});
    else
      scene.s->set_motion(scene.pin, start, end, pose(n), pose(n + 1));
    scene.s->advance(kShort, {});
    if (n == 7) early = scene.speed();
  }
  return {scene.speed() - early, scene.speed()};
}

}  // namespace

TEST_CASE("A plate whose points go off sideways carries a block, or slips under it, as Coulomb says",
          "[law][nightly]") {
  for (const double acceleration : {1.5, 6.0}) {
    const auto [pose_gain, pose_speed] = carry(acceleration, false);
    const auto [gain, speed] = carry(acceleration, true);
    const double wanted = 24.0 * kShort * std::min(acceleration, kFriction * kGravity);
    INFO(acceleration << " m/s^2: by points " << gain << " m/s more, " << speed << " in all, by the transform "
                      << pose_gain << ", " << pose_speed << ", Coulomb's " << wanted);
    CHECK(gain == Approx(wanted).epsilon(0.05));
    CHECK(pose_gain == Approx(wanted).epsilon(0.05));  // it hops a little, and rubs as it presses
    CHECK(speed == Approx(pose_speed).epsilon(0.02));
  }
}

namespace {

// A belt around two rollers, `moved` [m] along itself: its flat part is at y = 0.2, x from 0.1 to 0.8.
geometry::TriangleMesh belt_mesh(double moved) {
  constexpr double kPi = 3.14159265358979323846, kLeft = 0.1, kRight = 0.8, kRadius = 0.06, kTop = 0.2;
  constexpr int kAlong = 100;
  const double flat = kRight - kLeft, round = kPi * kRadius, length = 2.0 * (flat + round);
  const auto at = [&](double way, double z) {
    way = std::fmod(way, length);
    const auto turned = [&](double x, double angle) {
      return Vec3d(x + kRadius * std::sin(angle), kTop - kRadius + kRadius * std::cos(angle), z);
    };
    if (way < flat) return Vec3d(kLeft + way, kTop, z);
    way -= flat;
    if (way < round) return turned(kRight, way / kRadius);
    way -= round;
    if (way < flat) return Vec3d(kRight - way, kTop - 2.0 * kRadius, z);
    return turned(kLeft, kPi + (way - flat) / kRadius);
  };
  geometry::TriangleMesh mesh;
  for (const double z : {0.02, 0.38})
    for (int i = 0; i < kAlong; ++i) mesh.points.push_back(at(moved + length * i / kAlong, z));
  for (const double z : {0.02, 0.38}) mesh.points.push_back({0.5 * (kLeft + kRight), kTop - kRadius, z});
  for (std::int32_t i = 0; i < kAlong; ++i) {
    const std::int32_t next = (i + 1) % kAlong;
    mesh.triangles.push_back({i, kAlong + i, kAlong + next});
    mesh.triangles.push_back({i, kAlong + next, next});
    mesh.triangles.push_back({2 * kAlong, i, next});
    mesh.triangles.push_back({2 * kAlong + 1, kAlong + next, kAlong + i});
  }
  return mesh;
}

}  // namespace

TEST_CASE("A belt whose points run in its surface drags a block by its friction until it moves along",
          "[law][nightly]") {
  const double speed = 0.5;
  Carried scene(belt_mesh(0.0), 0.15);
  const auto points = [&](int n) { return belt_mesh(speed * kShort * std::max(0, n)).points; };
  double early = 0.0, late = 0.0;
  for (int n = -kStart; n < 40; ++n) {
    const double start = (kStart + n) * kShort;
    scene.s->set_points(scene.pin, {start, start + kShort, points(n), points(n + 1)});
    scene.s->advance(kShort, {});
    if (n == 3) early = scene.speed();
    if (n == 11) late = scene.speed();
  }
  const double found = (late - early) / (8.0 * kShort), end = scene.speed();
  const sim::SolidDiagnostics block = scene.s->diagnose_solid(1);
  INFO("slips: " << found << " m/s^2 for " << kFriction * kGravity << ", at last " << end << " m/s for " << speed
                 << ", height " << block.center[1]);
  CHECK(found == Approx(kFriction * kGravity).epsilon(0.05));
  CHECK(end == Approx(speed).epsilon(0.02));
  CHECK(block.center[1] == Approx(0.24 + sim::kContactSkin * kCell).margin(0.25 * kCell));
}

TEST_CASE("A collider whose points bound no volume ends the step, and the state is that before it") {
  sim::Params p = box_params({0.4, 0.4, 0.4}, kCell);
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  const geometry::TriangleMesh ball = ball_mesh({0.2, 0.2, 0.2}, 0.07);
  s->add_collider(desc_of(ball), report);
  std::vector<Vec3d> flat = ball.points;
  for (Vec3d& x : flat) x[1] = 0.2;
  s->set_points(0, {0.0, kFrame, ball.points, flat});
  CHECK_THROWS_WITH(s->advance(kFrame, {}), Catch::Contains("collider 1: its points at") && Catch::Contains("volume"));
  CHECK(all_finite(s->state()));
  const double time = s->state().time;
  CHECK(time < kFrame);
  std::vector<Vec3d> now;  // it goes on from there
  for (std::size_t v = 0; v < flat.size(); ++v)
    now.push_back((1.0 - time / kFrame) * ball.points[v] + time / kFrame * flat[v]);
  s->set_points(0, {time, kFrame, now, ball.points});
  s->advance(kFrame - time, {});
  CHECK(s->state().time == Approx(kFrame));
  CHECK_THROWS_WITH(s->set_points(0, {kFrame, 2 * kFrame, flat, ball.points}), Catch::Contains("collider 1"));
}

TEST_CASE("A disc whose points grow in a slab pushes its area out of an open side", "[law]") {
  sim::Params p = still({0.6, 0.4, kCell}, kCell);
  p.walls.face[1] = grid::Wall::kOpen;
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  const Vec3d center(0.213, 0.207, 0.5 * kCell);
  const auto disc = [&](int f) { return cylinder_mesh(2, center, 0.08 * (1.0 + 0.04 * f), 4.0 * kCell); };
  s->add_collider(desc_of(disc(0)), report);
  const auto area = [](int f) {
    return 24.0 * std::sin(3.14159265358979 / 24.0) * std::pow(0.08 * (1.0 + 0.04 * f), 2);
  };
  for (int f = 0; f < 5; ++f) {
    s->set_points(0, {f * kFrame, (f + 1) * kFrame, disc(f).points, disc(f + 1).points});
    double sum = 0.0;
    s->advance(kFrame, [&](double, const sim::StepInfo& last) {
      sum += last.dt * flux_out(*s);
      return false;
    });
    const double wanted = kCell * (area(f + 1) - area(f));
    INFO("frame " << f << ": out " << sum << " m^3, grown by " << wanted);
    CHECK(sum / wanted == Approx(1.0).margin(0.02));
  }
}
