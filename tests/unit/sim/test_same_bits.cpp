// Purpose: whole steps have the same bits with any number of threads, after a restart from a checkpoint, and in every
// instruction set. One table of scenes, each with what it is here for. (Kernels have tests of their own.)
//
// Instruction sets: with the environment variable EFSI_HASHES set to a file name the hashes of the table are compared
// with its lines, or added to it. A build with assertions has the basic instruction set alone: docs/testing.md.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>

#include "frame/window.hpp"
#include "solid/element/plasticity.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/hairpin.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

struct Row {
  std::string name;
  int frames;
  std::function<SimulationPtr(int threads)> make;
  std::function<void(sim::Simulation&, int frame)> advance;
  std::function<bool(const sim::Simulation&)> happens;  // after some frame, or the row would show nothing
};

std::function<void(sim::Simulation&, int)> in_steps_of(double dt) {
  return [dt](sim::Simulation& s, int) { s.step(dt); };
}
std::function<void(sim::Simulation&, int)> in_frames_of(double length) {
  return [length](sim::Simulation& s, int) { s.advance(length, {}); };
}
bool has_smoke(const sim::Simulation& s) {
  return std::ranges::any_of(s.state().fluid.smoke, [](Real density) { return density > 0; });
}
bool always(const sim::Simulation&) { return true; }
bool touches(const sim::Simulation& s) { return !s.contacts().empty(); }
bool pushes_rows(const sim::Simulation& s) { return !s.state().solids[0].contacts.empty(); }

sim::Params with(sim::Params p, int threads, sim::Preset preset = sim::Preset::kProduction) {
  p.threads = threads;
  p.numerics = sim::numerics_of(preset);
  return p;
}

sim::SolidDesc thrown(sim::SolidDesc d, const Vec3d& velocity, const Vec3d& spin = Vec3d::Zero()) {
  d.velocity = velocity;
  d.angular_velocity = spin;
  return d;
}

// A box of this size around a place as the region of an emitter or a force.
Eigen::Matrix4d region(const Vec3d& middle, const Vec3d& size) {
  Eigen::Matrix4d to_world = Eigen::Matrix4d::Identity();
  to_world.topLeftCorner<3, 3>() = size.asDiagonal();
  to_world.topRightCorner<3, 1>() = middle;
  return to_world.inverse();
}

// A ball above the floor, smoke at the start and smoke that flows in hot.
Row smoke(const char* name, sim::Preset preset) {
  const auto make = [preset](int threads) {
    auto s = make_simulation(with(box_params({0.3, 0.3, 0.3}, 0.025), threads, preset),
                             {thrown(ball_desc({0.15, 0.12, 0.15}, 0.08), {0.3, -2.0, 0.1})});
    fluid::Emitter e;
    e.from_world = region({0.15, 0.06, 0.15}, {0.3, 0.12, 0.3});
    s->add_emitter(e);
    e.from_world = region(Vec3d::Constant(0.25), Vec3d::Constant(0.125));
    e.mode = fluid::Emitter::Mode::kContinuous;
    e.end_time = 10.0;
    e.temperature = 2.0;
    s->add_emitter(e);
    return s;
  };
  return {name, 5, make, in_steps_of(0.02), has_smoke};
}

Row long_flight() {
  const auto make = [](int threads) {
    return make_simulation(with(box_params({0.5, 1.2, 0.5}, 0.025), threads),
                           {thrown(ball_desc({0.25, 0.95, 0.25}), {0.1, -3.0, 0.0}, {3.0, 1.0, 2.0})});
  };
  const auto is_long = [](const sim::Simulation& s) { return 3.0 * s.last_step().dt / 0.025 > 1.9; };  // cells
  return {"long steps of flight", 6, make, in_steps_of(0.1), is_long};
}

Row leaves_the_box() {
  const auto make = [](int threads) {
    sim::Params p = with(box_params({0.4, 0.3, 0.3}, 0.025), threads);
    p.walls.face[1] = grid::Wall::kOpen;
    return make_simulation(
        p, {thrown(ball_desc({0.3, 0.15, 0.15}, 0.06), {2.0, 0.3, 0.0}), ball_desc({0.1, 0.15, 0.15}, 0.06)});
  };
  const auto has_left = [](const sim::Simulation& s) { return solid::has_left(s.state().solids[0]); };
  return {"a solid leaves the box", 6, make, in_frames_of(0.04), has_left};
}

// Without fluid a step computes on a window, which moves along.
Row window(const char* name, sim::Preset preset) {
  const auto make = [preset](int threads) {
    return make_simulation(with(vacuum({0.6, 0.7, 0.5}, 0.025), threads, preset),
                           {thrown(ball_desc({0.2, 0.5, 0.25}), {1.5, -2.0, 0.3}, {0, 2, 4})});
  };
  const auto has_moved = [](const sim::Simulation& s) { return s.state().window.lo[0] > 5; };
  return {name, 16, make, in_steps_of(0.02), has_moved};
}

Row puff() {
  const auto make = [](int threads) {
    sim::Params p = with(still({0.6, 0.4, 0.4}), threads);
    p.walls.face[1] = grid::Wall::kOpen;
    auto s = make_simulation(p, {ball_desc({0.35, 0.2, 0.2}, 0.08)});
    fluid::Emitter e;
    e.shape = fluid::Emitter::Shape::kSphere;
    e.from_world = region({0.15, 0.2, 0.2}, Vec3d::Constant(0.14));
    e.mode = fluid::Emitter::Mode::kContinuous;
    e.end_time = 1e6;
    e.has_velocity = true;
    e.velocity = {2, 0.4, 0};
    e.keys = {
        {0.0, 0.0, 0.0, {0, 0, 0}, true}, {0.1, 1.0, 20.0, {2, 0.4, 0}, true}, {0.15, 1.0, 0.0, {0, 0, 1}, false}};
    s->add_emitter(e);
    return s;
  };
  return {"a puff with keys", 5, make, in_frames_of(kFrame), always};
}

// Legs of a U that are thrown at each other.
Row folds() {
  const auto make = [](int threads) {
    Hairpin pin;
    pin.gap = 7;
    pin.low = {17, 18, 6};
    sim::SolidDesc d = desc_of(pin.surface());
    d.youngs_modulus = 1e4;
    auto s = make_simulation(with(still_vacuum({1.0, 0.8, 0.8}, kCell), threads), {d});
    solid::SolidState state = s->state().solids[0];
    const grid::Grid& g = state.band.grid;
    const double middle = kCell * (pin.low[0] + 4 + 0.5 * pin.gap), foot = kCell * (pin.low[2] + 4);
    for (std::size_t n = 0; n < g.node_count(); ++n) {
      const auto [i, j, k] = g.node_place(n);
      const Vec3d x = g.node_position(i, j, k);
      const double up = std::max(0.0, (x[2] - foot) / (23 * kCell));
      const double side = std::clamp((x[0] - middle) / (5 * kCell), -1.0, 1.0);
      state.v.set(n, Vec3(static_cast<Real>(-0.8 * side * up * up), 0, 0));
    }
    state.speed = 0.8;
    s->set_solids({state});
    return s;
  };
  return {"folds push each other", 4, make, in_frames_of(0.025), pushes_rows};
}

Row bulk(const char* name, double nu) {
  const auto make = [nu](int threads) {
    sim::Params p = with(box_params({0.36, 0.36, 0.36}, 0.02), threads);
    p.fluid.density = 100.0;
    sim::SolidDesc ball = thrown(ball_desc({0.18, 0.12, 0.18}, 0.08), {0.3, -2.0, 0.1});  // onto the floor
    ball.youngs_modulus = 2.0 * (1.0 + nu) * 1e4;
    ball.poissons_ratio = nu;
    ball.compressible = true;
    return make_simulation(p, {ball});
  };
  return {name, 6, make, in_steps_of(0.01), always};
}

Row plastic() {
  const auto make = [](int threads) {
    sim::SolidDesc d = ball_desc({0.3, 0.3, 0.3});
    d.plastic = {1000.0, 50.0, 0.0};
    d.rayleigh_beta = 0.003;
    d.stretch = {1.3, 0.877, 0.877};
    return make_simulation(with(still_vacuum({0.6, 0.6, 0.6}, 0.025), threads), {d});
  };
  const auto flows = [](const sim::Simulation& s) { return solid::largest_plastic_strain(s.state().solids[0]) > 0.05; };
  return {"plastic flow", 8, make, in_steps_of(0.005), flows};
}

// Balls that fly into each other and rub.
Row contact() {
  const auto make = [](int threads) {
    std::vector<sim::SolidDesc> balls = {thrown(ball_desc({0.38, 0.325, 0.25}), {1.0, 0, 0}),
                                         thrown(ball_desc({0.62, 0.375, 0.25}), {-1.0, 0, 0})};
    for (sim::SolidDesc& ball : balls) ball.friction = 0.3;
    return make_simulation(with(still({1.0, 0.7, 0.5}), threads), balls);
  };
  return {"two solids touch", 6, make, in_steps_of(0.01), pushes_rows};
}

Row particles() {
  const auto make = [](int threads) {
    std::vector<sim::SolidDesc> balls = {thrown(ball_desc({0.38, 0.235, 0.21}), {1.0, 0, 0}),
                                         thrown(ball_desc({0.62, 0.265, 0.21}), {-1.0, 0, 0})};
    for (sim::SolidDesc& ball : balls) ball.friction = 0.5;
    return make_simulation(with(still({1.0, 0.5, 0.42}), threads, sim::Preset::kPaper2016), balls);
  };
  return {"contact by particles", 6, make, in_steps_of(0.01), touches};
}

// A ball falls on a collider that turns and whose points grow upwards.
Row moving_points() {
  const Vec3d center(0.2, 0.12, 0.2);
  const geometry::TriangleMesh mesh = ball_mesh(center, 0.07);
  const auto make = [mesh](int threads) {
    auto s = make_simulation(with(box_params({0.5, 0.4, 0.4}), threads), {ball_desc({0.23, 0.28, 0.2}, 0.07)});
    geometry::MeshReport report;
    s->add_collider(desc_of(mesh), report);
    return s;
  };
  const auto advance = [mesh, center](sim::Simulation& s, int f) {
    const auto pose = [&](int n) {
      const Mat3d turn = solid::rotation({0.0, 0.0, 0.1 * n});
      return sim::Pose{turn, center - turn * center};
    };
    const auto points = [&](int n) {
      std::vector<Vec3d> moved = mesh.points;
      for (Vec3d& x : moved) x[1] += 0.15 * n * (x[1] - center[1]);
      return moved;
    };
    s.set_motion(0, f * kFrame, (f + 1) * kFrame, pose(f), pose(f + 1));
    s.set_points(0, {f * kFrame, (f + 1) * kFrame, points(f), points(f + 1)});
    s.advance(kFrame, {});
  };
  return {"a collider turns, and its points move", 6, make, advance, touches};
}

// A bar hangs from its upper end, which turns and goes.
Row pin() {
  const auto make = [](int threads) {
    auto s = make_simulation(with(box_params({0.4, 0.6, 0.4}), threads));
    sim::SolidDesc bar = desc_of(block({0.2, 0.4, 0.2}, {0.05, 0.15, 0.05}));
    bar.youngs_modulus = 2e5;
    bar.rayleigh_alpha = 3.0;
    geometry::MeshReport report;
    s->add_solid(bar, report);
    std::vector<std::uint8_t> held;
    for (const Vec3d& x : bar.surface.points) held.push_back(x[1] > 0.5);
    s->add_pin(0, held);
    return s;
  };
  const auto advance = [](sim::Simulation& s, int f) {
    const auto pose = [](int n) { return sim::Pose{solid::rotation({0, 0.1 * n, 0}), {0.004 * n, 0, 0}}; };
    s.set_motion(0, f * kFrame, (f + 1) * kFrame, pose(f), pose(f + 1));
    s.advance(kFrame, {});
  };
  return {"a pin moves", 4, make, advance, always};
}

// Two discs in a viscous fluid that a lid drives.
Row slab() {
  const auto make = [](int threads) {
    sim::Params p = with(still({0.5, 0.5, 0.02}), threads);
    p.fluid.density = 200.0;
    p.fluid.viscosity = 2.0;
    p.gravity = {0, -9.8, 0};
    p.walls.face[3] = grid::Wall::kNoSlip;
    p.walls.velocity[3] = {0.4, 0, 0};
    const auto disc = [](double x, double y) { return desc_of(cylinder_mesh(2, {x, y, 0.01}, 0.06, 0.04)); };
    return make_simulation(p, {disc(0.15, 0.1), thrown(disc(0.17, 0.25), {0, -1.0, 0})});
  };
  return {"a slab with viscosity", 6, make, in_frames_of(kFrame), touches};
}

Row wind() {
  const auto make = [](int threads) {
    auto s = make_simulation(with(still({0.6, 0.6, 0.6}, 0.025), threads), {ball_desc({0.3, 0.3, 0.3})});
    sim::ForceField force;
    force.from_world = region(Vec3d::Constant(0.3), Vec3d::Constant(2.0));
    force.kind = sim::ForceField::Kind::kWind;
    force.end_time = 1e6;
    force.wind_velocity = {1.0, 0, 0};
    force.noise_speed = 0.5;
    force.noise_frequency = 3.0;
    s->add_force(force);
    return s;
  };
  return {"wind with noise", 3, make, in_steps_of(0.01), always};
}

void compare_instruction_sets(const std::string& name, std::uint64_t hash) {
  const char* path = std::getenv("EFSI_HASHES");
  if (!path) return;
  std::ifstream in(path);
  std::string line, found;
  while (std::getline(in, line))
    if (line.starts_with(name + ": ")) found = line.substr(name.size() + 2);
  if (found.empty())
    std::ofstream(path, std::ios::app) << name << ": " << hash << '\n';
  else
    CHECK(std::to_string(hash) == found);
}

void check(const Row& row) {
  INFO(row.name);
  const auto file = std::filesystem::temp_directory_path() / ("efsi_bits_" + std::to_string(std::random_device{}()));
  const auto whole = row.make(1);
  std::vector<std::uint64_t> hashes;
  bool happened = false;
  for (int frame = 0; frame < row.frames; ++frame) {
    row.advance(*whole, frame);
    hashes.push_back(sim::state_hash(whole->state()));
    happened = happened || row.happens(*whole);
  }
  CHECK(happened);
  compare_instruction_sets(row.name, hashes.back());
  // On two threads, and from every frame on one frame on three and on eight: fresh ones first, then ones that have
  // been further.
  const auto two = row.make(2);
  const SimulationPtr restarted[2] = {row.make(3), row.make(8)};
  for (int frame = 0; frame + 1 < row.frames; ++frame) {
    INFO("frame " << frame);
    row.advance(*two, frame);
    CHECK(sim::state_hash(two->state()) == hashes[static_cast<std::size_t>(frame)]);
    sim::save_checkpoint(*two, file.string());
    sim::Simulation& later = *restarted[frame % 2];
    sim::restore_checkpoint(later, file.string());
    CHECK(sim::state_hash(later.state()) == hashes[static_cast<std::size_t>(frame)]);
    row.advance(later, frame + 1);
    CHECK(sim::state_hash(later.state()) == hashes[static_cast<std::size_t>(frame) + 1]);
  }
  row.advance(*two, row.frames - 1);
  CHECK(sim::state_hash(two->state()) == hashes.back());
  std::filesystem::remove(file);
}

}  // namespace

TEST_CASE("Whole steps have the same bits: scenes x threads x restarts x instruction sets", "[determinism]") {
  for (const Row& row : {smoke("smoke", sim::Preset::kProduction), leaves_the_box(),
                         window("the window moves", sim::Preset::kProduction), folds(), bulk("nu 0.49", 0.49),
                         plastic(), contact(), particles(), moving_points(), pin(), slab()})
    check(row);
}

TEST_CASE("Whole steps have the same bits: the other scenes", "[determinism][nightly]") {
  for (const Row& row :
       {smoke("smoke, paper2016", sim::Preset::kPaper2016), long_flight(),
        window("the window moves, paper2016", sim::Preset::kPaper2016), puff(), bulk("nu 0.4", 0.4), wind()})
    check(row);
}
