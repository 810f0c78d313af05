// Purpose: what is reported of solids that push each other: who, how deep, what impulse, how much of it sticks.
#include <catch2/catch.hpp>
#include <cmath>

#include "contact/solid_contact.hpp"
#include "record/contact_record.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kSlope = M_PI / 6, kWeight = 9.8;

sim::Params space() { return still_vacuum({1.0, 0.5, 0.5}, kCell); }

// Three balls in a row; the first two fly towards each other.
std::vector<sim::SolidDesc> balls(bool compressible = false) {
  std::vector<sim::SolidDesc> all = {ball_desc({0.85, 0.25, 0.25}), ball_desc({0.16, 0.25, 0.25}),
                                     ball_desc({0.44, 0.25, 0.25})};
  all[1].velocity = {0.5, 0.0, 0.0};
  all[2].velocity = {-0.5, 0.0, 0.0};
  for (sim::SolidDesc& ball : all) ball.compressible = compressible;
  return all;
}

// A block at rest on a slab on the floor, gravity tilted by kSlope.
SimulationPtr block_on_slab(double friction) {
  sim::Params p = vacuum({0.8, 0.4, 0.4}, kCell);
  p.max_time_step = 1.0 / 96.0;
  p.gravity = kWeight * Vec3d(std::sin(kSlope), -std::cos(kSlope), 0.0);
  std::vector<sim::SolidDesc> d(2);
  d[0].surface = block({0.4, 0.045, 0.2}, {0.36, 0.045, 0.15});
  d[1].surface = block({0.25, 0.14 + sim::kContactSkin * kCell, 0.2}, {0.1, 0.05, 0.1});
  for (sim::SolidDesc& solid : d) {
    solid.youngs_modulus = 5e5;
    solid.poissons_ratio = 0.2;
    solid.rayleigh_beta = 2e-3;
    solid.compressible = true;
    solid.friction = friction;
  }
  return make_simulation(p, d);
}

}  // namespace

TEST_CASE("The record of two balls that meet has the impulse that turns them around", "[law]") {
  const bool compressible = GENERATE(true, false);
  auto s = make_simulation(space(), balls(compressible));
  s->step(1e-6);
  CHECK(s->contacts().empty());
  const Vec3d before = s->diagnose_solid(2).momentum;
  sim::ContactPairs sums;
  double deepest = 1.0;
  while (s->state().time < 0.35) {
    const sim::StepInfo info = s->step(0.02);
    CHECK(info.contacts.size() == s->contacts().size());
    sim::add_contacts(info.contacts, sums);
    if (!info.contacts.empty())
      for (const sim::RowPlace& place : s->workspace().elasticity.contacts.places)
        deepest = std::min(deepest, place.gap / kCell);
  }
  REQUIRE(sums.size() == 1);
  const sim::ContactPair& pair = sums[0];
  const Vec3d turned = s->diagnose_solid(2).momentum - before;
  INFO("impulse " << pair.impulse.transpose() << " for " << turned.transpose() << ", rows " << pair.rows << ", pushing "
                  << pair.active_rows << ", overlap " << pair.row_overlap << " and " << pair.surface_overlap);
  CHECK(pair.one == 1);
  CHECK(pair.other == 2);
  CHECK(pair.steps > 5);
  CHECK(pair.rows >= pair.active_rows);
  CHECK(pair.active_rows >= pair.steps);
  CHECK(pair.sticking_rows == 0);
  CHECK(pair.row_overlap == Approx(-deepest));
  CHECK(pair.surface_overlap == Approx(pair.row_overlap - sim::kContactSkin).margin(0.3));
  // Where cells are cut by both, a little of the pressure goes over, too.
  CHECK((pair.impulse - turned).norm() < (compressible ? 1e-4 : 1e-2) * turned.norm());
  CHECK(pair.normal_impulse >= 0.999 * pair.impulse.norm());
  CHECK(s->contacts().empty());
}

TEST_CASE("The record of a call is the sum of its steps, and starts anew with the next") {
  auto s = make_simulation(space(), balls());
  sim::ContactPairs sums, seen;
  s->advance(0.15, [&](double, const sim::StepInfo& last) {
    sim::add_contacts(last.contacts, sums);
    seen = s->contacts();
    return false;
  });
  REQUIRE(sums.size() == 1);
  REQUIRE(s->contacts().size() == 1);
  CHECK(sums[0].active_rows == s->contacts()[0].active_rows);
  CHECK(sums[0].normal_impulse == s->contacts()[0].normal_impulse);
  CHECK(seen[0].normal_impulse == sums[0].normal_impulse);
  s->set_state(sim::State(s->state()));
  CHECK(s->contacts().empty());
}

TEST_CASE("The record tells the weight that rests on a solid, and whether it sticks", "[law]") {
  const bool sticks = GENERATE(true, false);
  const double friction = sticks ? 0.7 : 0.3;  // tan kSlope: 0.577
  auto s = block_on_slab(friction);
  s->advance(0.2, {});
  s->advance(0.1, {});
  REQUIRE(s->contacts().size() == 1);
  const sim::ContactPair& pair = s->contacts()[0];
  const double load = s->diagnose_solid(1).mass * kWeight * 0.1;  // weight's impulse [N s]
  const double share = static_cast<double>(pair.sticking_rows) / static_cast<double>(pair.active_rows);
  INFO((sticks ? "sticks" : "slides") << ": " << pair.impulse.transpose() << " N s, load " << load << ", share "
                                      << share << ", overlap " << pair.row_overlap);
  CHECK(pair.impulse[1] == Approx(load * std::cos(kSlope)).epsilon(0.03));
  CHECK(-pair.impulse[0] == Approx(sticks ? load * std::sin(kSlope) : friction * pair.impulse[1]).epsilon(0.05));
  CHECK(pair.normal_impulse == Approx(pair.impulse[1]).epsilon(0.02));
  CHECK((sticks ? share : 1.0 - share) > 0.65);  // at the edges, where little pushes, rows slide in what sticks
  CHECK(std::abs(pair.row_overlap) < 0.25);
}
