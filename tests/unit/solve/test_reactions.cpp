// Purpose: what holds a body that rests is its weight, in every frame, whether what it rests on has moved before or
// not.
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr int kRises = 6, kRisen = 12;  // frames between which the plate moves

sim::SolidDesc block_desc(const Vec3d& low, const Vec3d& high) {
  sim::SolidDesc d = desc_of(block(0.5 * (low + high), 0.5 * (high - low)));
  d.youngs_modulus = 1e5;
  d.poissons_ratio = 0.3;
  return d;
}

sim::Pose raised(double speed, int frame) {
  return {Mat3d::Identity(), {0.0, speed * kFrame * std::clamp(frame - kRises, 0, kRisen - kRises), 0.0}};
}

// Impulse along y that holds it in a frame.
double impulse_in_frame(sim::Simulation& s, std::size_t pin) {
  double sum = 0.0;
  s.advance(kFrame, [&](double, const sim::StepInfo& last) {
    sum += last.pins[pin].impulse[1];
    return false;
  });
  return sum;
}

}  // namespace

TEST_CASE("A collider holds the weight of a block that rests on it in every frame, also where it has risen",
          "[law][nightly]") {
  for (const double fluid : {0.0, 100.0})
    for (const double speed : {0.0, 0.24}) {
      sim::Params p = box_params({0.6, 0.6, 0.6}, kCell);
      p.fluid.present = fluid > 0.0;
      if (p.fluid.present) p.fluid.density = fluid;
      const auto s = make_simulation(p, {block_desc({0.22, 0.21, 0.22}, {0.38, 0.35, 0.38})});
      geometry::MeshReport report;
      const std::size_t pin = s->add_collider(block_desc({0.05, 0.06, 0.05}, {0.55, 0.2, 0.55}), report);
      const double volume = 0.16 * 0.14 * 0.16;
      const double weight = 9.8 * kFrame * (s->diagnose_solid(0).mass - fluid * volume);
      for (int frame = 0; frame < 30; ++frame) {
        s->set_motion(pin, frame * kFrame, (frame + 1) * kFrame, raised(speed, frame), raised(speed, frame + 1));
        const double before = s->diagnose_solid(0).momentum[1];
        const double impulse = impulse_in_frame(*s, pin);
        const double gained = weight + s->diagnose_solid(0).momentum[1] - before;
        INFO("fluid " << fluid << ", speed " << speed << ", frame " << frame << ": impulse " << impulse / weight
                      << " of the weight, gained " << gained / weight);
        if (fluid == 0.0) CHECK(std::abs(impulse - gained) < 0.01 * weight);
        if (frame >= 20) CHECK(impulse == Approx(weight).epsilon(fluid > 0.0 ? 0.01 : 0.002));
      }
    }
}

TEST_CASE("What pins a body holds the weight of a block that rests on it, too", "[law][slow]") {
  sim::Params p = vacuum({0.6, 0.6, 0.6}, kCell);
  const auto s = make_simulation(
      p, {block_desc({0.22, 0.21, 0.22}, {0.38, 0.33, 0.38}), block_desc({0.15, 0.06, 0.15}, {0.45, 0.2, 0.45})});
  const geometry::TriangleMesh around = block({0.3, 0.06, 0.3}, {0.2, 0.05, 0.2});
  const std::size_t pin = s->add_pin(1, geometry::examine(around, sim::kRestSpacing * kCell)->distance);
  const double weight = 9.8 * kFrame * (s->diagnose_solid(0).mass + s->diagnose_solid(1).mass);
  for (int frame = 0; frame < 48; ++frame) {
    const double impulse = impulse_in_frame(*s, pin);
    INFO("frame " << frame << ": " << impulse / weight << " of the weight");
    if (frame >= 40) CHECK(impulse == Approx(weight).epsilon(0.002));
  }
}

TEST_CASE("The floor carries the weight of all that is stacked on it", "[law][nightly]") {
  for (const double fluid : {0.0, 100.0})
    for (const bool stacked : {false, true}) {
      sim::Params p = box_params({0.4, 0.6, 0.4}, kCell);
      p.fluid.present = fluid > 0.0;
      if (p.fluid.present) p.fluid.density = fluid;
      std::vector<sim::SolidDesc> blocks = {block_desc({0.1, 0.004, 0.1}, {0.3, 0.17, 0.3})};
      if (stacked) blocks.push_back(block_desc({0.12, 0.178, 0.12}, {0.28, 0.32, 0.28}));
      for (sim::SolidDesc& d : blocks) d.friction = 0.5;  // soft blocks without friction slide off each other
      const auto s = make_simulation(p, blocks);
      double weight = 0.0, pressed = 0.0;  // sums over the last steps of ten frames
      for (int frame = 0; frame < 30; ++frame) {
        s->advance(kFrame, {});
        if (frame < 20) continue;
        for (std::size_t l = 0; l < blocks.size(); ++l) {
          weight += 9.8 * s->diagnose_solid(l).mass * (1.0 - fluid / 1000.0);
          for (const solid::WallImpulse& press : s->state().solids[l].presses)
            if (press.axis == 1) pressed += static_cast<double>(press.force);
        }
      }
      INFO("fluid " << fluid << ", blocks " << blocks.size() << ": " << pressed / weight << " of the weight");
      CHECK(pressed == Approx(weight).epsilon(stacked ? 0.01 : 0.001));
    }
}
