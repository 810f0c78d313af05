// Purpose: the part of the pressure that is carried makes the fluid second order in time, and moves nothing by itself.
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kPi = 3.14159265358979;

// Gives the fluid the velocity that flow says of each node.
template <class Flow>
void set_flow(sim::Simulation& s, const Flow& flow) {
  const grid::Grid& g = s.grid();
  std::vector<float> v(3 * g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d at = flow(Vec3i{i, j, k});
        for (std::size_t a = 0; a < 3; ++a)
          v[a * g.node_count() + g.node(i, j, k)] = static_cast<float>(at[static_cast<Eigen::Index>(a)]);
      }
  s.set_velocity(v.data());
}

// A row of Taylor-Green vortices in a box that is one cell thick, 1 m across: what is left of its energy after a
// second.
double kept_by_vortices(double step, bool carries) {
  constexpr double kAcross = 1.0;
  sim::Params p = still({kAcross, kAcross, 1.0 / 32.0}, 1.0 / 32.0);
  p.max_time_step = step;
  p.numerics.carries_pressure = carries;
  auto s = make_simulation(p);
  const grid::Grid& g = s->grid();
  set_flow(*s, [&](const Vec3i& at) {
    const Vec3d x = kPi / kAcross * g.node_position(at[0], at[1], at[2]);
    return Vec3d(std::sin(x[0]) * std::cos(x[1]), -std::cos(x[0]) * std::sin(x[1]), 0.0);
  });
  const auto energy = [&] {
    double sum = 0.0;
    const grid::VectorField& now = s->fluid_velocity();
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const double part = (i % g.cells[0] ? 1.0 : 0.5) * (j % g.cells[1] ? 1.0 : 0.5);
        sum += part * now.at(g.node(i, j, 0)).cast<double>().squaredNorm();
      }
    return sum;
  };
  const double first = energy();
  advance_to(*s, 1.0);
  return energy() / first;
}

// How far a ball as dense as the fluid has moved on in a closed box of it, after a tenth of a second.
double moved(double step, bool carries) {
  sim::Params p = still({0.8, 0.4, 0.4});
  p.fluid.density = 1000.0;
  p.max_time_step = step;
  p.numerics.carries_pressure = carries;
  sim::SolidDesc d = ball_desc({0.3, 0.2, 0.2}, 0.06);
  d.velocity = {1.0, 0.0, 0.0};
  auto s = make_simulation(p, {d});
  advance_to(*s, 0.1);
  return s->diagnose_solid(0).center[0] - 0.3;
}

}  // namespace

TEST_CASE("Vortices keep their energy in long steps, and what they lose falls with the square of the step", "[law]") {
  const double dt = 1.0 / 24.0;
  const double before = 1.0 - kept_by_vortices(dt, false), lost = 1.0 - kept_by_vortices(dt, true);
  INFO("energy lost " << lost << ", with all of the pressure after the transport " << before);
  CHECK(std::abs(lost) < 0.02);
  CHECK(before > 5.0 * std::abs(lost));
}

TEST_CASE("In short steps a solid moves through fluid alike, whether a part of the pressure is carried or not",
          "[law]") {
  const double all = moved(0.002, false), part = moved(0.002, true);
  INFO("moved " << all << ", " << part << " m");
  CHECK(part == Approx(all).epsilon(0.01));
}

TEST_CASE("Nodes on the faces of a periodic box are the same as those opposite after every step") {
  sim::Params p = still({1.0, 1.0, 1.0 / 32.0}, 1.0 / 32.0);
  p.walls.face[0] = p.walls.face[1] = p.walls.face[2] = p.walls.face[3] = grid::Wall::kPeriodic;
  p.fluid.viscosity = 0.01;
  p.max_time_step = 0.01;
  auto s = make_simulation(p);
  const grid::Grid& g = s->grid();
  set_flow(*s, [&](const Vec3i& at) {
    const Vec3d x = 2.0 * kPi * g.node_position(at[0] % g.cells[0], at[1] % g.cells[1], at[2]);
    return Vec3d(std::sin(x[0]) * std::cos(x[1]) + 0.3, -std::cos(x[0]) * std::sin(x[1]) - 0.2, 0.0);
  });
  for (int step = 0; step < 5; ++step) {
    s->step(0.01);
    const grid::VectorField& now = s->fluid_velocity();
    int apart = 0;
    for (int n = 0; n <= g.cells[0]; ++n) {
      apart += now.at(g.node(0, n, 0)) != now.at(g.node(g.cells[0], n, 0));
      apart += now.at(g.node(n, 0, 0)) != now.at(g.node(n, g.cells[1], 0));
    }
    CHECK(apart == 0);  // one that rounding has led elsewhere would go on by itself, and grow
  }
}

// In steps of a frame, by which the velocity of the state is ahead of the ball by half a step.
TEST_CASE("What is read of the fluid around a ball let go is no more than buoyancy gave", "[fluid][law]") {
  constexpr double kRatio = 0.3, kGravity = 9.81;
  sim::Params p = box_params({0.6, 0.8, 0.6}, 0.025);
  p.gravity = Vec3d(0, -kGravity, 0);
  p.fluid.density = 1000.0;
  sim::SolidDesc d = ball_desc({0.3, 0.25, 0.3}, 0.1);
  d.density = kRatio * p.fluid.density;
  const auto s = make_simulation(p, {d});
  const double from = s->diagnose_solid(0).center[1];
  for (int i = 0; i < 4; ++i) {
    s->step(1.0 / 24.0);
    const sim::SolidDiagnostics ball = s->diagnose_solid(0);
    const double work = (1.0 / kRatio - 1.0) * ball.mass * kGravity * (ball.center[1] - from);
    const double energy = ball.kinetic_energy + s->diagnose_fluid().kinetic_energy;
    INFO("step " << i << ": " << energy / work << " of the work");
    CHECK(energy < 1.05 * work);
    CHECK(energy > 0.5 * work);
  }
}
