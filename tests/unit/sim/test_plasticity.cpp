// Purpose: solids that yield, in whole steps: what they keep, that it is state, that others pay nothing.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "solid/element/plasticity.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const Vec3d kMiddle(0.3, 0.3, 0.3);

sim::Params box(double h) { return still_vacuum({0.6, 0.6, 0.6}, h); }

sim::SolidDesc plastic_ball(const Vec3d& center, double yield_stress, double rate = 1e6) {
  sim::SolidDesc d = ball_desc(center, kBallRadius);
  d.plastic = {yield_stress, rate, 0.0};
  d.rayleigh_beta = 0.003;
  return d;
}

// Pulls solid 0 along x at constant volume, about the middle.
void pull(sim::Simulation& s, double stretch) {
  const grid::Grid& g = s.state().solids[0].band.grid;
  const std::size_t n = g.node_count();
  const Vec3d f(stretch, 1.0 / std::sqrt(stretch), 1.0 / std::sqrt(stretch));
  std::vector<float> u(3 * n);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        for (int a = 0; a < 3; ++a) {
          const double away = g.node_position(i, j, k)[a] - kMiddle[a];
          u[static_cast<std::size_t>(a) * n + g.node(i, j, k)] = static_cast<float>(away * (1.0 - 1.0 / f[a]));
        }
  s.set_solid_field(0, false, u.data());
}

double length_along_x(sim::Simulation& s) {
  const sim::SolidDiagnostics d = s.diagnose_solid(0);
  return (d.extent_max[0] - d.extent_min[0]) / (2.0 * kBallRadius);
}

// Elastic stretch of a bar at the yield stress, constant volume, lambda of no account.
double yield_stretch(double mu, double yield_stress) {
  double low = 1.0, high = 1.5;
  for (int it = 0; it < 60; ++it) {
    const double s = 0.5 * (low + high);
    (2.0 * mu * (s * s - s - 1.0 / s + 1.0 / std::sqrt(s)) > yield_stress ? high : low) = s;
  }
  return low;
}

}  // namespace

TEST_CASE("A ball that is pulled beyond its yield stress keeps the stretch that is not elastic", "[law][slow]") {
  const double yield_stress = 3000.0, stretch = 1.4;
  auto s = make_simulation(box(0.02), {plastic_ball(kMiddle, yield_stress)});
  pull(*s, stretch);
  advance_by(*s, 1.0, 0.01);
  const double expected = stretch / yield_stretch(1e4, yield_stress);
  CHECK(length_along_x(*s) == Approx(expected).epsilon(0.01));
  const sim::SolidDiagnostics d = s->diagnose_solid(0);
  CHECK(d.volume_mesh == Approx(d.rest_volume).epsilon(0.01));
  CHECK(d.max_plastic_strain == Approx(std::log(expected)).epsilon(0.05));
  // It stays: neither hourglass modes nor the volume source pull it back.
  const double before = length_along_x(*s);
  advance_by(*s, 1.0, 0.01);
  CHECK(length_along_x(*s) == Approx(before).epsilon(1e-3));

  auto elastic = make_simulation(box(0.02), {plastic_ball(kMiddle, 0.0)});
  pull(*elastic, stretch);
  advance_by(*elastic, 1.0, 0.01);
  CHECK(length_along_x(*elastic) == Approx(1.0).epsilon(0.01));
}

TEST_CASE("Half the time step changes what a ball keeps by less than a hundredth", "[law][nightly]") {
  const double rate = GENERATE(100.0, 300.0, 1e3, 1e6);
  const auto kept = [&](double dt) {
    auto s = make_simulation(box(0.02), {plastic_ball(kMiddle, 2000.0, rate)});
    pull(*s, 1.4);
    advance_by(*s, 0.3, dt);
    return length_along_x(*s) - 1.0;
  };
  const double coarse = kept(0.002), fine = kept(0.001);
  CHECK(coarse > (rate > 100.0 ? 0.2 : 0.09));
  CHECK(fine == Approx(coarse).epsilon(0.01));
}

TEST_CASE("A ball that yields on the floor keeps a dent, an elastic one does not; flow only takes energy") {
  sim::Params p = box(0.02);
  p.gravity = {0, -9.8, 0};
  p.energy_ledger = true;
  const auto height_after = [&](double yield_stress, double& dissipated) {
    auto s = make_simulation(p, {plastic_ball({0.3, 0.15, 0.3}, yield_stress)});
    double taken = 0.0;
    for (int n = 0; n < 24; ++n) {
      const double end = s->state().time + 1.0 / 24;
      while (end - s->state().time > 1e-9) {
        const sim::StepInfo info = s->step(end - s->state().time);
        const sim::Energy& flow = info.energy->change[static_cast<std::size_t>(sim::EnergyStage::kPlasticFlow)];
        CHECK(flow.elastic <= 1e-9);
        taken -= flow.elastic;
      }
    }
    dissipated = taken;
    const sim::SolidDiagnostics d = s->diagnose_solid(0);
    return d.extent_max[1] - d.extent_min[1];
  };
  double elastic_loss = 0.0, plastic_loss = 0.0;
  const double elastic = height_after(0.0, elastic_loss), plastic = height_after(600.0, plastic_loss);
  CHECK(elastic_loss == 0.0);
  CHECK(plastic_loss > 0.01);
  CHECK(elastic > 0.9 * 2.0 * kBallRadius);
  CHECK(plastic < 0.8 * 2.0 * kBallRadius);
}

TEST_CASE("A soft plastic ball of five cells that a floor flattens to a pancake: no energy, nothing torn", "[law]") {
  sim::Params p = box(0.06);
  p.domain_size = {1.44, 0.9, 1.44};
  p.gravity.setZero();
  p.fluid.present = GENERATE(false, true);
  p.energy_ledger = true;
  sim::SolidDesc d = desc_of(ball_mesh({0.72, 0.15, 0.72}, 0.15));
  d.youngs_modulus = 8000.0;
  d.plastic = {300.0, 1000.0, 0.0};
  d.stretch = {1.4, 0.7, 1.0};
  d.velocity = {0, -2, 0};
  auto s = make_simulation(p, {d});
  double lowest = 1e9, largest = 0.0, rise = 0.0;
  while (s->state().time < 0.4 - 1e-9) {
    const sim::StepInfo info = s->step(std::min(1.0 / 24, 0.4 - s->state().time));
    CHECK(info.repairs.repaired_cells == 0);
    CHECK(info.energy->change[static_cast<std::size_t>(sim::EnergyStage::kPlasticFlow)].elastic <= 1e-9);
    const double energy = info.energy->at_start.sum();
    lowest = std::min(lowest, energy);
    largest = std::max(largest, energy);
    rise = std::max(rise, energy - lowest);
  }
  CHECK(rise < 0.01 * largest);
  const sim::SolidDiagnostics end = s->diagnose_solid(0);
  CHECK(end.extent_max[1] - end.extent_min[1] < 0.12);
  CHECK(end.max_plastic_strain > 2.0);
}

TEST_CASE("The hash of a state covers plastic strain") {
  const auto s = make_simulation(box(0.025), {plastic_ball(kMiddle, 1000.0, 50.0)});
  pull(*s, 1.3);
  advance_by(*s, 0.04, 0.005);
  sim::State changed = s->state();
  changed.solids[0].plastic[0].accumulated += Real(1);
  CHECK(sim::state_hash(changed) != sim::state_hash(s->state()));
}

TEST_CASE("A solid that cannot yield carries nothing; one that can is told apart") {
  auto elastic = make_simulation(box(0.025), {plastic_ball(kMiddle, 0.0)});
  auto plastic = make_simulation(box(0.025), {plastic_ball(kMiddle, 1000.0)});
  auto other = make_simulation(box(0.025), {plastic_ball(kMiddle, 1001.0)});
  elastic->step(0.001);
  plastic->step(0.001);
  CHECK(elastic->state().solids[0].plastic.capacity() == 0);
  CHECK(elastic->workspace().solids[0].hourglass_force.capacity() == 0);
  const std::uint64_t nodes = plastic->state().solids[0].plastic.size();
  CHECK(nodes == plastic->solids()[0].lattice.node_count());
  CHECK(plastic->memory_bytes() >= elastic->memory_bytes() + 2 * nodes * sizeof(solid::PlasticNode));
  CHECK(plastic->scene_hash() != elastic->scene_hash());
  CHECK(plastic->scene_hash() != other->scene_hash());
  sim::SolidDesc bad = plastic_ball(kMiddle, 1000.0);
  bad.plastic.hardening = -1.0;
  geometry::MeshReport report;
  CHECK_THROWS_WITH(make_simulation(box(0.025))->add_solid(bad, report),
                    Catch::Contains("EfsiSolidDef.plastic_hardening = -1: must be a finite number >= 0"));
}
