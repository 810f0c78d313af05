// Purpose: a state that was read from a file, whatever its hash says, has the counts and places of the simulation.
#include <limits>

#include "sim/checkpoint.hpp"
#include "sim/state_fits.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using Catch::Contains;

namespace {

SimulationPtr stepped(bool fluid) {
  sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  p.fluid.present = fluid;
  sim::SolidDesc d = ball_desc({0.15, 0.12, 0.15}, 0.08);
  d.plastic = {500.0, 100.0, 0.0};
  d.compressible = true;
  d.poissons_ratio = 0.4;
  auto s = make_simulation(p, {d});
  s->step(0.01);
  return s;
}

}  // namespace

TEST_CASE("A state of the simulation itself fits, and each array of another length or place is named") {
  const bool fluid = GENERATE(true, false);
  const auto s = stepped(fluid);
  const auto fault = [&](const std::function<void(sim::State&)>& change) {
    sim::State state = s->state();
    change(state);
    return sim::state_fault(state, s->state(), s->grid(), s->solids());
  };
  const auto body = [&](const std::function<void(solid::SolidState&)>& change) {
    return fault([&](sim::State& state) { change(state.solids[0]); });
  };
  CHECK(fault([](sim::State&) {}) == "");
  CHECK_THAT(body([](auto& b) { b.u.c[1].pop_back(); }), Contains("solid 1: u: "));
  CHECK_THAT(body([](auto& b) { b.v.c[2].push_back(0); }), Contains("solid 1: v: "));
  CHECK_THAT(body([](auto& b) { b.change.c[0].pop_back(); }), Contains("solid 1: change: "));
  CHECK_THAT(body([](auto& b) { b.change.c[2].clear(); }), Contains("solid 1: change: 0 values"));
  CHECK_THAT(body([](auto& b) { b.change_time = 0.0; }), Contains("solid 1: change_time: must be"));
  CHECK_THAT(fault([](sim::State& state) { state.fluid.carried_time = -1.0; }), Contains("carried_time: must be"));
  CHECK_THAT(body([](auto& b) { b.valid.clear(); }), Contains("solid 1: valid: 0 values: must be "));
  CHECK_THAT(body([](auto& b) { b.stiff.resize(1); }), Contains("solid 1: stiff: 1 values"));
  CHECK_THAT(body([](auto& b) { b.plastic.pop_back(); }), Contains("solid 1: plastic: "));
  CHECK_THAT(body([](auto& b) { b.dilatation.pop_back(); }), Contains("solid 1: dilatation: "));
  CHECK_THAT(body([](auto& b) { b.dilatation[0] = std::numeric_limits<Real>::infinity(); }), Contains("not finite"));
  CHECK_THAT(body([](auto& b) { b.surface.pop_back(); }), Contains("solid 1: surface: "));
  CHECK_THAT(body([](auto& b) { b.u.c[0][3] = std::numeric_limits<Real>::quiet_NaN(); }), Contains("not finite"));
  CHECK_THAT(body([](auto& b) { b.surface[0][1] = std::numeric_limits<double>::infinity(); }), Contains("not finite"));
  CHECK_THAT(body([](auto& b) { b.band.grid.lo[1] = -1; }), Contains("must lie in the box"));
  CHECK_THAT(body([](auto& b) { b.band.grid.lo[0] = std::numeric_limits<int>::max(); }), Contains("in the box"));
  CHECK_THAT(body([](auto& b) { b.band.grid.cells[2] = 1 << 20; }), Contains("must lie in the box"));
  CHECK_THAT(body([](auto& b) { b.band.grid.cells[2] = 0; }), Contains("must lie in the box"));
  CHECK_THAT(body([](auto& b) { b.band.grid.h *= 2; }), Contains("on the nodes of the box"));
  CHECK_THAT(body([](auto& b) { b.presses.push_back({{0, 0, 0}, 3, 1, {0, 0, 0}, 0}); }), Contains("presses"));
  CHECK_THAT(fault([](sim::State& state) { state.time = std::numeric_limits<double>::quiet_NaN(); }), Contains("time"));
  CHECK_THAT(fault([](sim::State& state) { state.fluid.smoke.resize(5); }), Contains("fluid: smoke: 5 values"));
  CHECK_THAT(fault([](sim::State& state) { state.fluid.velocity.c[2].push_back(0); }), Contains("fluid: velocity: "));
  CHECK_THAT(fault([](sim::State& state) { state.fluid.pressure.push_back(0); }), Contains("fluid: pressure: "));
  if (!fluid)
    CHECK_THAT(fault([](sim::State& state) { state.window.cells[0] = 1 << 30; }), Contains("window: must lie"));
}
