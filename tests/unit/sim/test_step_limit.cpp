// Purpose: a step says which rule has limited it, and which bodies that looked at.
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using sim::StepRule;

namespace {

sim::StepInfo first_step(const sim::Params& p, const std::vector<sim::SolidDesc>& solids,
                         double duration = 1.0 / 24.0) {
  return make_simulation(p, solids)->step(duration);
}

sim::SolidDesc ball(const Vec3d& center, const Vec3d& velocity) {
  sim::SolidDesc d = ball_desc(center, 0.08);
  d.velocity = velocity;
  return d;
}

}  // namespace

TEST_CASE("A step says what limits it") {
  sim::Params p = vacuum({1.0, 1.0, 1.0}, 0.025);
  p.gravity = Vec3d::Zero();
  const Vec3d center(0.5, 0.5, 0.5);

  sim::StepInfo info = first_step(p, {ball(center, Vec3d::Zero())});
  CHECK((info.limit_rule == StepRule::kEnd && info.limiting_solid == 0 && info.dt == Approx(1.0 / 24.0)));
  info = first_step(p, {ball(center, {20.0, 0.0, 0.0})});
  CHECK((info.limit_rule == StepRule::kSpeed && info.limiting_solid == 1));
  info = first_step(p, {ball({0.5, 0.09, 0.5}, {0.0, -5.0, 0.0})});
  CHECK((info.limit_rule == StepRule::kWall && info.limiting_solid == 1 && info.limiting_other == 0));
  info = first_step(p, {ball({0.4, 0.5, 0.5}, {5.0, 0.0, 0.0}), ball({0.57, 0.5, 0.5}, Vec3d::Zero())});
  CHECK((info.limit_rule == StepRule::kSolid && info.limiting_solid == 1 && info.limiting_other == 2));

  p.max_time_step = 0.001;
  info = first_step(p, {ball(center, Vec3d::Zero())});
  CHECK((info.limit_rule == StepRule::kMaximum && info.dt <= 0.001));

  // In a dense fluid the first step of a solid that moves is short; without solids the speed of the fluid counts.
  sim::Params wet = box_params({0.5, 0.5, 0.5}, 0.025);
  wet.gravity = Vec3d::Zero();
  wet.fluid.density = 1000.0;
  CHECK(first_step(wet, {ball({0.25, 0.25, 0.25}, {1.0, 0.0, 0.0})}).limit_rule == StepRule::kStart);
  auto fluid = make_simulation(wet, {});
  const std::vector<float> values(3 * fluid->grid().node_count(), 20.0f);
  fluid->set_velocity(values.data());
  CHECK(fluid->step(1.0 / 24.0).limit_rule == StepRule::kFluid);
}

TEST_CASE("A film that two solids squeeze does not limit the step") {
  sim::Params p = box_params({0.6, 0.4, 0.4}, 0.02);
  p.gravity = Vec3d::Zero();
  p.cfl_fluid = 0.3;
  auto s = make_simulation(p, {ball({0.2, 0.2, 0.2}, {2.0, 0.0, 0.0}), ball({0.4, 0.2, 0.2}, {-2.0, 0.0, 0.0})});
  double film = 0.0;  // most cells that it moves in a step
  while (s->state().time < 0.02) {
    const double limiting = s->state().fluid_speed;
    const sim::StepInfo info = s->step(0.02 - s->state().time);
    CHECK(info.dt * limiting / p.voxel_size < p.cfl_fluid * (1.0 + 1e-6));
    CHECK(s->state().fluid_speed <= info.max_speed_fluid);
    film = std::max(film, info.dt * info.max_speed_fluid / p.voxel_size);
  }
  CHECK(film > 1.5 * p.cfl_fluid);
}
