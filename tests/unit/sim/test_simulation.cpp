// Purpose: bookkeeping of a simulation: time, parameters, threads, memory, retries.
#include <functional>
#include <limits>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// A ball above the floor of a small box with smoke around it; coarse, so that several runs are cheap.
sim::Params small_params(int threads) {
  sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  p.threads = threads;
  return p;
}

SimulationPtr small_scene(const sim::Params& p) {
  sim::SolidDesc d = ball_desc({0.15, 0.12, 0.15}, 0.08);
  d.velocity = {0.3, -2.0, 0.1};
  auto s = make_simulation(p, {d});
  fluid::Emitter e;
  e.from_world.diagonal() << 1 / 0.3, 1 / 0.12, 1 / 0.3, 1;
  e.from_world(0, 3) = -0.5;
  e.from_world(2, 3) = -0.5;
  s->add_emitter(e);
  return s;
}

// Runs body and returns the message of the Error that it must throw.
template <class Body>
std::string refusal(ErrorCode code, const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    CHECK(static_cast<int>(error.code()) == static_cast<int>(code));
    return error.what();
  }
  FAIL("nothing was refused");
  return {};
}

bool contains(const std::string& text, const std::string& part) {
  INFO("message: " << text);
  CHECK(text.find(part) != std::string::npos);
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("A ball with a hole spins about its own centre, wherever it is", "[law]") {
  sim::Params p = small_params(1);
  p.domain_min = {100, -50, 20};
  sim::SolidDesc d = ball_desc(p.domain_min + Vec3d(0.15, 0.12, 0.15), 0.08);
  d.surface.triangles.resize(d.surface.triangles.size() - 6);
  d.angular_velocity = {5, -10, 20};
  const auto start = make_simulation(p, {d})->diagnose_solid(0);
  INFO("centre moves at " << start.momentum.norm() / start.mass << " m/s");
  CHECK(start.momentum.norm() < 0.005 * start.mass * d.angular_velocity.norm() * 0.08);
}

TEST_CASE("Looking at a simulation does not change it", "[determinism]") {
  auto a = small_scene(small_params(1)), b = small_scene(small_params(1));
  for (int n = 0; n < 3; ++n) {
    a->step(0.02);
    b->diagnose_solid(0);
    b->diagnose_fluid();
    b->surface_velocity(0);
    b->step(0.02);
    b->solid_fraction();
  }
  CHECK(sim::state_hash(a->state()) == sim::state_hash(b->state()));
}

TEST_CASE("Two simulations in one process do not see each other", "[determinism]") {
  auto alone = small_scene(small_params(1));
  for (int n = 0; n < 2; ++n) alone->step(0.02);
  auto a = small_scene(small_params(1)), b = make_simulation(box_params({0.2, 0.2, 0.2}));
  for (int n = 0; n < 2; ++n) {
    a->step(0.02);
    b->step(0.03);
  }
  CHECK(sim::state_hash(a->state()) == sim::state_hash(alone->state()));
}

TEST_CASE("The hash sees a change of one bit") {
  auto s = small_scene(small_params(1));
  s->step(0.01);
  sim::State state = s->state();
  const std::uint64_t hash = sim::state_hash(state);
  Real& v = state.solids[0].u.c[2][17];
  v = std::nextafter(v, Real(1));
  CHECK(sim::state_hash(state) != hash);
  CHECK(sim::state_hash(s->state()) == hash);
}

TEST_CASE("An advance lands exactly on its end in equal steps that the limits allow") {
  auto s = small_scene(small_params(1));
  double largest = 0.0, smallest = 1.0;
  int calls = 0;
  const auto info = s->advance(1.0 / 24.0, [&](double fraction, const sim::StepInfo& last) {
    ++calls;
    CHECK(fraction > 0.0);
    CHECK(fraction <= 1.0 + 1e-12);
    largest = std::max(largest, last.dt * std::max(last.max_speed_solid, last.max_speed_fluid / 5.0 * 1.8));
    smallest = std::min(smallest, last.dt);
    return false;
  });
  CHECK(s->state().time == 1.0 / 24.0);
  CHECK(static_cast<std::uint64_t>(calls) == info.steps);
  CHECK(s->state().steps == info.steps);
  CHECK(smallest > 0.0);
  CHECK(largest < 2.2 * 0.025);  // CFL 1.8, and what gravity adds within a step
}

TEST_CASE("Cancelling keeps the last completed step") {
  auto s = small_scene(small_params(1)), twin = small_scene(small_params(1));
  refusal(ErrorCode::kCancelled, [&] { s->advance(0.5, [](double, const sim::StepInfo&) { return true; }); });
  CHECK(s->state().steps == 1);
  CHECK(s->state().time > 0.0);
  twin->step(0.5);
  CHECK(sim::state_hash(s->state()) == sim::state_hash(twin->state()));
}

TEST_CASE("Parameters that make no sense are refused by name, value and limit") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    std::function<void(sim::Params&)> change;
    std::string field;
  };
  const Case cases[] = {
      {[](auto& p) { p.voxel_size = 0; }, "voxel_size = 0"},
      {[](auto& p) { p.voxel_size = -0.5; }, "voxel_size = -0.5"},
      {[&](auto& p) { p.voxel_size = nan; }, "voxel_size = "},
      {[](auto& p) { p.domain_size[1] = -2; }, "domain_size.y = -2"},
      {[](auto& p) { p.voxel_size = 1e-5; }, "domain_size.x"},
      {[&](auto& p) { p.domain_min[2] = nan; }, "domain_min.z"},
      {[&](auto& p) { p.gravity[0] = nan; }, "gravity.x"},
      {[](auto& p) { p.fluid.density = 0; }, "fluid_density = 0"},
      {[](auto& p) { p.cfl_solid = 1001; }, "cfl_solid = 1001"},
      {[](auto& p) { p.cfl_fluid = -1; }, "cfl_fluid = -1"},
      {[](auto& p) { p.max_time_step = -1; }, "max_time_step = -1"},
      {[](auto& p) { p.walls.face[2] = grid::Wall::kPeriodic; }, "wall.y"},
      {[](auto& p) { p.numerics.pressure_tolerance = 0; }, "pressure_tolerance = 0"},
      {[](auto& p) { p.numerics.velocity_tolerance = 2; }, "velocity_tolerance = 2"},
      {[](auto& p) { p.fluid.vorticity_confinement = -3; }, "vorticity_confinement = -3"},
      {[](auto& p) { p.threads = -1; }, "threads = -1"},
  };
  for (const Case& c : cases) {
    sim::Params p = box_params({0.3, 0.3, 0.3});
    c.change(p);
    contains(refusal(ErrorCode::kArgument, [&] { sim::Simulation s(p, Log{}); }), c.field);
  }
  sim::Params p = box_params({1, 1, 1}, 0.01);
  p.memory_limit = 1 << 20;
  const std::string text = refusal(ErrorCode::kMemory, [&] { sim::Simulation s(p, Log{}); });
  contains(text, "voxel_size = 0.01");
  contains(text, "would fit");
}

TEST_CASE("Solids that make no sense are refused by name, value and limit, and leave nothing behind") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    std::function<void(sim::SolidDesc&)> change;
    std::string field;
  };
  const Case cases[] = {
      {[](auto& d) { d.density = 0; }, "density = 0"},
      {[](auto& d) { d.youngs_modulus = -5; }, "youngs_modulus = -5"},
      {[](auto& d) { d.poissons_ratio = 0.5; }, "poissons_ratio = 0.5"},
      {[](auto& d) { d.rayleigh_alpha = -1; }, "rayleigh_alpha = -1"},
      {[](auto& d) { d.rayleigh_beta = -2; }, "rayleigh_beta = -2"},
      {[](auto& d) { d.friction = -0.1; }, "friction = -0.1"},
      {[&](auto& d) { d.velocity[1] = nan; }, "velocity"},
      {[&](auto& d) { d.angular_velocity[1] = nan; }, "angular_velocity"},
      {[](auto& d) {
         d.surface = ball_mesh({0.25, 0.15, 0.15}, 0.08);
       },
       "mesh: extends"},
  };
  auto s = make_simulation(box_params({0.3, 0.3, 0.3}, 0.025));
  geometry::MeshReport report;
  for (const Case& c : cases) {
    sim::SolidDesc d = ball_desc({0.15, 0.15, 0.15}, 0.08);
    c.change(d);
    contains(refusal(ErrorCode::kArgument, [&] { s->add_solid(d, report); }), c.field);
    CHECK(s->state().solids.empty());
  }
  for (const double dt : {0.0, -1.0, nan}) refusal(ErrorCode::kArgument, [&] { s->step(dt); });
  s->step(0.01);
  contains(refusal(ErrorCode::kArgument, [&] { s->add_solid(ball_desc({0.15, 0.15, 0.15}, 0.08), report); }), "before");
}

TEST_CASE("Five solids cost five bands, not five grids") {
  sim::Params p = box_params({1.2, 1.2, 1.2}, 0.025);
  std::vector<sim::SolidDesc> solids;
  for (const Vec3d& c :
       {Vec3d(0.3, 0.3, 0.3), Vec3d(0.9, 0.3, 0.3), Vec3d(0.3, 0.9, 0.3), Vec3d(0.3, 0.3, 0.9), Vec3d(0.9, 0.9, 0.9)})
    solids.push_back(ball_desc(c, 0.06));
  auto one = make_simulation(p, {solids[0]}), five = make_simulation(p, solids);
  one->step(0.005);
  five->step(0.005);
  const auto band = five->diagnose_solid(4);
  const auto added = static_cast<double>(five->memory_bytes() - one->memory_bytes());
  // Each band has its state twice (the last good step), its workspace and its part of the velocity system.
  CHECK(added > 4.0 * 0.9 * static_cast<double>(band.memory_bytes));
  CHECK(added < 4.0 * 2.5 * static_cast<double>(band.memory_bytes));
  const double grid_state = 6.0 * sizeof(Real) * static_cast<double>(five->grid().node_count());
  CHECK(added < grid_state);  // four solids together: less than u and v of one on the whole grid
  CHECK(five->state().solids[4].band.grid.node_count() * 10 < five->grid().node_count());
}

TEST_CASE("A ball in fluid takes no more than 142 bytes per cell of the box") {
  sim::Params p = box_params({1.6, 1.6, 1.6}, 0.025);
  auto s = make_simulation(p, {ball_desc({0.8, 0.8, 0.8}, 0.2)});
  for (int step = 0; step < 3; ++step) s->step(0.005);
  CHECK(static_cast<double>(s->memory_bytes()) < 142.0 * static_cast<double>(s->grid().cell_count()));
}

TEST_CASE("A state that cannot be advanced is reported as diverged and rolled back") {
  auto s = small_scene(small_params(1));
  s->step(0.005);
  const std::size_t nodes = s->state().solids[0].v.size();
  std::vector<float> v(3 * nodes, 0.0f);
  v[nodes / 2] = std::numeric_limits<float>::quiet_NaN();
  s->set_solid_field(0, true, v.data());
  const std::uint64_t before = sim::state_hash(s->state());
  const std::uint64_t steps = s->state().steps;
  const std::string text = refusal(ErrorCode::kDiverged, [&] { s->step(0.005); });
  contains(text, "time");
  CHECK(s->state().steps == steps);
  CHECK(sim::state_hash(s->state()) == before);
  // With a good velocity the same simulation goes on.
  v[nodes / 2] = 0.0f;
  s->set_solid_field(0, true, v.data());
  s->step(0.005);
  CHECK(s->state().steps == steps + 1);
  CHECK(all_finite(s->state()));
}

TEST_CASE("The pressure of a first step, in which the solid moves rigidly, converges") {
  sim::Params p = small_params(2);
  p.walls.face.fill(grid::Wall::kNoSlip);
  p.fluid.density = 1.0;
  sim::SolidDesc d = ball_desc({0.15, 0.15, 0.15}, 0.08);
  d.velocity = {0.0, -2.0, 0.0};
  auto s = make_simulation(p, {d});
  const sim::StepInfo info = s->step(0.005);
  CHECK(info.unconverged == 0);
  CHECK(info.pressure_iterations > 0);
  CHECK(info.pressure_iterations < 30);
  CHECK(info.divergence_after < 0.02 * info.divergence_before);
}

TEST_CASE("A solid that has lost its shape ends the run at the last good state") {
  auto s = small_scene(small_params(1));
  s->step(0.005);
  const grid::Grid g = s->state().solids[0].band.grid;
  const std::uint64_t steps = s->state().steps;
  // Neighbours exchanged: every second plane of nodes along x is moved by 1.5 cells.
  std::vector<float> u(3 * g.node_count(), 0.0f);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; i += 2) u[g.node(i, j, k)] = static_cast<float>(1.5 * g.h);
  s->set_solid_field(0, false, u.data());
  const std::uint64_t before = sim::state_hash(s->state());
  const std::string text = refusal(ErrorCode::kDiverged, [&] { s->step(0.005); });
  contains(text, "solid 1 has lost its shape");
  contains(text, "last good step");
  CHECK(s->state().steps == steps);
  CHECK(sim::state_hash(s->state()) == before);
}

TEST_CASE("Absurd speeds are survived or reported") {
  for (const double speed : {50.0, 5000.0}) {
    sim::Params p = small_params(1);
    sim::SolidDesc d = ball_desc({0.15, 0.15, 0.15}, 0.08);
    d.velocity = {speed, -speed, 0.0};
    auto s = make_simulation(p, {d});
    try {
      for (int n = 0; n < 8; ++n) s->step(1.0 / 24.0);
    } catch (const Error& error) {
      CHECK(static_cast<int>(error.code()) == static_cast<int>(ErrorCode::kDiverged));
    }
    CHECK(all_finite(s->state()));
    CHECK(s->state().time >= 0.0);
  }
}

TEST_CASE("A random displacement inside a solid ends without a value that is not finite") {
  auto s = small_scene(small_params(1));
  s->set_solid_field(0, false, noise(3 * s->state().solids[0].band.grid.node_count(), 0.08f).data());
  try {
    s->advance(0.05, {});
  } catch (const Error& error) {
    CHECK(static_cast<int>(error.code()) == static_cast<int>(ErrorCode::kDiverged));
  }
  CHECK(all_finite(s->state()));
}

TEST_CASE("A solid that comes to a periodic face ends the run with the last good state and a word about it") {
  sim::Params p = small_params(1);
  p.gravity.setZero();
  p.walls.face[0] = p.walls.face[1] = grid::Wall::kPeriodic;
  sim::SolidDesc d = ball_desc({0.15, 0.15, 0.15}, 0.08);
  d.velocity = {0, 0.5, 0};
  auto beside = make_simulation(p, {d});
  CHECK_NOTHROW(beside->advance(0.05, {}));  // other axes have no such face
  d.velocity = {0.5, 0, 0};
  auto towards = make_simulation(p, {d});
  const std::string message = refusal(ErrorCode::kDiverged, [&] { towards->advance(0.3, {}); });
  contains(message, "solid 1 has come within a cell of the periodic faces along x");
  double right = 0.0;
  for (const Vec3d& x : towards->state().solids[0].surface) right = std::max(right, x[0]);
  CHECK(right > 0.24);
  CHECK(right <= 0.275);
}
