// Purpose: solids that leave the box through an open face.
#include "base/error.hpp"
#include "nodes/step_weight.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr std::size_t kThrown = 0;

// A ball that is thrown out through the upper face of x.
sim::SolidDesc thrown_ball() {
  sim::SolidDesc d = ball_desc({0.25, 0.15, 0.15}, 0.06);
  d.velocity = {2.0, 0.4, 0.0};
  return d;
}

// What of its motion the tests name.
struct Flight {
  std::uint64_t retries = 0;
  bool finite = true;
  Vec3d velocity = Vec3d::Zero();  // of its surface in the last frame
  double bent = 0.0;               // [m]: the farthest that a vertex has moved otherwise than the first in that frame
};
Flight fly(sim::Simulation& s, int frames) {
  Flight f;
  std::vector<Vec3d> before;
  for (int frame = 0; frame < frames; ++frame) {
    before = s.state().solids[kThrown].surface;
    f.retries += s.advance(kFrame, {}).retries;
    f.finite = f.finite && all_finite(s.state());
  }
  const std::vector<Vec3d>& after = s.state().solids[kThrown].surface;
  const Vec3d way = after[0] - before[0];
  f.velocity = way / kFrame;
  for (std::size_t i = 0; i < after.size(); ++i) f.bent = std::max(f.bent, (after[i] - before[i] - way).norm());
  return f;
}

}  // namespace

TEST_CASE("A ball leaves through an open face, goes straight on, and the rest of the scene does not notice") {
  const bool fluid = GENERATE(false, true);
  const sim::Preset preset = GENERATE(sim::Preset::kProduction, sim::Preset::kPaper2016);
  INFO("fluid " << fluid << ", preset " << static_cast<int>(preset));
  sim::Params p = still({0.4, 0.3, 0.3}, 0.02, fluid);
  p.fluid.density = 1.0;
  p.numerics = sim::numerics_of(preset);
  p.energy_ledger = true;
  p.walls.face[1] = grid::Wall::kOpen;
  p.walls.face[2] = p.walls.face[3] = grid::Wall::kPeriodic;  // it flies on across this face, too, outside
  auto s = make_simulation(p, {thrown_ball(), ball_desc({0.1, 0.15, 0.15}, 0.05)});
  const Flight f = fly(*s, 16);
  CHECK(f.retries == 0);
  CHECK(f.finite);
  CHECK(solid::has_left(s->state().solids[kThrown]));
  const auto gone = s->diagnose_solid(kThrown);
  CHECK(gone.mass == 0.0);
  CHECK(gone.elements == 0);
  CHECK(gone.kinetic_energy == 0.0);
  CHECK(gone.false_edges == 0);
  CHECK(gone.extent_min[1] > 0.3);
  CHECK((f.velocity - Vec3d(2.0, 0.4, 0.0)).norm() < 0.05);
  CHECK(f.bent < 1e-9);
  CHECK((s->surface_velocity(kThrown)[0] - f.velocity).norm() < 1e-5);
  const auto stays = s->diagnose_solid(1);
  CHECK(stays.mass == Approx(1000.0 * stays.rest_volume).epsilon(preset == sim::Preset::kProduction ? 1e-6 : 0.1));
  CHECK((stays.center - Vec3d(0.1, 0.15, 0.15)).norm() < 0.01);
}

TEST_CASE("What has left the box limits no step") {
  auto alone = make_simulation(
      [] {
        sim::Params p = still_vacuum({0.4, 0.3, 0.3});
        p.walls.face[1] = grid::Wall::kOpen;
        return p;
      }(),
      {thrown_ball()});
  fly(*alone, 8);
  REQUIRE(solid::has_left(alone->state().solids[kThrown]));
  CHECK(alone->advance(kFrame, {}).steps == 1);
  CHECK(alone->last_step().max_speed_solid == 0.0);
}

TEST_CASE("Solids of every kind leave the box") {
  sim::SolidDesc d = thrown_ball();
  SECTION("compressible") { d.compressible = true; }
  SECTION("plastic") { d.plastic.yield_stress = 500.0; }
  SECTION("in a dense fluid, which a wind moves") {}
  sim::Params p = box_params({0.4, 0.3, 0.3});
  p.walls.face[1] = grid::Wall::kOpen;
  auto s = make_simulation(p, {d});
  sim::ForceField wind;
  wind.kind = sim::ForceField::Kind::kWind;
  wind.wind_velocity = {2.0, 0.0, 0.0};
  wind.wind_drag = 5.0;
  s->add_force(wind);
  const Flight f = fly(*s, 14);
  CHECK(f.retries == 0);
  CHECK(f.finite);
  CHECK(solid::has_left(s->state().solids[kThrown]));
}

TEST_CASE("A pinned ball that is led out has left, and does not come back") {
  sim::Params p = box_params({0.4, 0.3, 0.3});
  p.walls.face[1] = grid::Wall::kOpen;
  auto s = make_simulation(p, {ball_desc({0.25, 0.15, 0.15}, 0.06)});
  const auto hand = geometry::examine(ball_mesh({0.25, 0.15, 0.15}, 0.04), sim::kRestSpacing * p.voxel_size);
  const std::size_t pin = s->add_pin(0, hand->distance);
  const auto at = [](int frame) {
    sim::Pose pose;
    pose.shift[0] = 0.035 * (10 - std::abs(frame - 10));
    return pose;
  };
  for (int frame = 0; frame < 20; ++frame) {
    s->set_motion(pin, frame * kFrame, (frame + 1) * kFrame, at(frame), at(frame + 1));
    s->advance(kFrame, {});
  }
  CHECK(solid::has_left(s->state().solids[0]));
  CHECK(all_finite(s->state()));
  CHECK(s->last_step().pins[pin].impulse.norm() == 0.0);
}

TEST_CASE("A solid that vanishes inside the box is an error") {
  sim::Params p = still_vacuum({0.4, 0.3, 0.3});
  p.walls.face[1] = grid::Wall::kOpen;
  auto s = make_simulation(p, {ball_desc({0.2, 0.15, 0.15}, 0.06)});
  s->step(0.01);
  sim::State state = s->state();
  std::fill(state.solids[0].valid.begin(), state.solids[0].valid.end(), solid::kNoData);
  s->set_state(std::move(state));
  CHECK_THROWS_WITH(s->step(0.01), Catch::Contains("has vanished"));
}

TEST_CASE("A light solid that has left does not lift the fluid") {
  sim::Params p = box_params({0.4, 0.3, 0.3});
  p.fluid.density = 1000.0;
  sim::SolidDesc light = ball_desc({0.1, 0.15, 0.15}, 0.06), heavy = ball_desc({0.3, 0.15, 0.15}, 0.06);
  light.density = 10.0;
  auto s = make_simulation(p, {light, heavy});
  const std::vector<sim::ForceField> forces;
  const sim::Scene scene{s->params(), s->grid(), s->solids(), s->emitters(), forces, s->pins()};
  sim::SolidWorks works(2);
  works[0].total_mass = works[1].total_mass = 1.0;
  CHECK(sim::weight_in_step(scene, 0.01, works).fluid.norm() > Real(0.05));
  works[0].total_mass = 0.0;
  CHECK(sim::weight_in_step(scene, 0.01, works).fluid.norm() == 0);
}
