// Purpose: a step that takes more of a solid's energy than its tolerance allows is repeated shorter.
#include "sim/step_loss.hpp"
#include "unit/sim/free_solid.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// A ball thrown at a floor without weight in vacuum, in steps of at most a frame: nothing but what it loses makes the
// step short in which it hits.
struct Landing {
  std::uint64_t steps = 0, retries = 0;
  double rebound = 0.0, rise = 0.0, volume = 0.0;  // energy after it and made in it, over that before; off, by the mesh
  std::vector<Vec3d> surface;
};

Landing land(double youngs_modulus, int across = 8, int threads = 1) {
  constexpr double kRadius = 0.1, kSpeed = 2.0;
  sim::Params p = still_vacuum({0.4, 0.4, 0.4}, 2.0 * kRadius / across);
  p.threads = threads;
  p.energy_ledger = true;
  sim::SolidDesc d = ball_desc({0.2, kRadius + 0.03, 0.2}, kRadius);
  d.youngs_modulus = youngs_modulus;
  d.velocity = {0.0, -kSpeed, 0.0};
  auto s = make_simulation(p, {d});
  Landing l;
  const double start = s->diagnose_solid(0).kinetic_energy;
  // Kinetic and elastic energy at the ends of steps, and as the ledger pairs them at their starts: an impact that fits
  // into one step reads as a rise in one of them.
  double least[2] = {start, start}, rise[2] = {}, up = 0.0;
  while (s->state().time < 0.1 && up < 0.02) {
    const sim::StepInfo info = s->step(kFrame);
    const auto now = s->diagnose_solid(0);
    const double energy[2] = {now.kinetic_energy + now.elastic_energy, info.energy->at_start.sum()};
    for (std::size_t i = 0; i < 2; ++i) {
      rise[i] = std::max(rise[i], (energy[i] - least[i]) / start);
      least[i] = std::min(least[i], energy[i]);
    }
    l.rise = std::min(rise[0], rise[1]);
    l.rebound = energy[0] / start;
    l.volume = std::max(l.volume, std::abs(now.volume_mesh / now.rest_volume - 1.0));
    l.steps += info.steps, l.retries += info.retries;
    up = now.extent_min[1];
    if (now.momentum[1] < 0.0) up = 0.0;
  }
  l.surface = s->surface_points(0);
  return l;
}

// Upward over downward speed of a ball that is thrown at a floor, in steps of at most dt.
double restitution(double dt, bool compressible) {
  sim::Params p = still_vacuum({0.4, 0.4, 0.4}, 0.02);
  sim::SolidDesc d = ball_desc({0.2, 0.12, 0.2}, 0.1);
  d.velocity = {0.0, -2.0, 0.0};
  d.compressible = compressible;
  auto s = make_simulation(p, {d});
  double up = 0.0;
  while (s->state().time < 0.15) {
    s->step(dt);
    const auto now = s->diagnose_solid(0);
    up = std::max(up, now.momentum[1] / now.mass);
  }
  return up / 2.0;
}

// Steps and energy left of that at the start when a ball that is let go stretched has swung once or twice in vacuum.
struct Swing {
  std::uint64_t steps = 0;
  double energy = 0.0;
};

Swing swing(double tolerance) {
  constexpr double kStretch = 1.05;
  sim::Params p = still_vacuum({0.4, 0.4, 0.4}, 0.025);
  p.numerics.step_tolerance = tolerance;
  auto s = make_simulation(p, {ball_desc({0.2, 0.2, 0.2}, 0.1)});
  stretch(*s, Vec3d::Constant(0.2), {kStretch, 1.0 / std::sqrt(kStretch), 1.0 / std::sqrt(kStretch)});
  const double start = s->diagnose_solid(0).elastic_energy;
  Swing swing;
  while (s->state().time < 0.2) swing.steps += s->step(kFrame).steps;
  const auto now = s->diagnose_solid(0);
  swing.energy = (now.kinetic_energy + now.elastic_energy) / start;
  return swing;
}

}  // namespace

TEST_CASE("A tolerance below the normal one holds in flight too", "[law]") {
  const Swing normal = swing(sim::kNormalTolerance), fine = swing(0.05), finer = swing(0.02);
  INFO(normal.steps << " steps, " << fine.steps << ", " << finer.steps << "; energy left " << normal.energy << ", "
                    << fine.energy << ", " << finer.energy);
  CHECK(normal.steps == 5);
  CHECK(normal.energy < 0.3);
  CHECK(fine.energy > 0.7);
  CHECK(finer.energy > fine.energy);
  CHECK(fine.steps < 150);
}

TEST_CASE("A ball rebounds in its own steps nearly as in short ones", "[law]") {
  const bool compressible = GENERATE(false, true);
  const double own = restitution(kFrame, compressible), with_short = restitution(1e-3, compressible);
  INFO((compressible ? "compressible: " : "incompressible: ") << own << ", in steps of 1 ms " << with_short);
  CHECK(own > (compressible ? 0.72 : 0.70));
  CHECK(std::abs(with_short - own) < 0.12);
}

TEST_CASE("However stiff a ball is, it bounces: a step that takes its energy is repeated", "[law]") {
  const double modulus = GENERATE(2e4, 1e5, 1e6, 1e7, 1e8);
  const int across = modulus == 1e7 ? GENERATE(8, 20) : 8;
  const Landing l = land(modulus, across);
  INFO("Young's modulus " << modulus << ", " << across << " across: " << l.rebound << " of its energy left, " << l.rise
                          << " made, volume by " << l.volume << ", " << l.steps << " steps, " << l.retries
                          << " repeated");
  CHECK(l.rebound > 0.25);
  CHECK(l.rise < 0.02);
  CHECK(l.volume < 0.01);
  CHECK((l.retries > 0) == (modulus > 5e5));
}

TEST_CASE(
    "What a step has lost limits the next ones: they are rarely repeated, and the same for any number of threads") {
  const Landing one = land(1e7), three = land(1e7, 8, 3);
  CHECK(one.retries > 0);
  CHECK(4 * one.retries < one.steps);
  CHECK(one.surface == three.surface);
}
