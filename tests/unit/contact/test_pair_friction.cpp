// Purpose: Coulomb's law of two bodies as a whole, after the pressure.
#include <catch2/catch.hpp>
#include <cmath>

#include "contact/pair_friction.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// Two bodies, or a collider and a body, with two rows between them: what the pressure adds to them is told.
struct TwoRows {
  sim::Params params = still_vacuum({0.4, 0.4, 0.4});
  grid::Grid box = sim::make_grid(params);
  std::vector<solid::SolidRest> rests = std::vector<solid::SolidRest>(2);
  std::vector<fluid::Emitter> emitters;
  std::vector<sim::ForceField> forces;
  std::vector<sim::Pin> pins;
  sim::SolidStates states = sim::SolidStates(2);
  Parallel parallel{1};
  sim::Profile profile;
  sim::StepInfo info;
  sim::Holds holds{{{{0, 1}, {7}, 0}}, {0, 0}};  // they touch nothing but each other
  sim::SolidContacts contacts;
  std::vector<solid::Momenta> momenta = std::vector<solid::Momenta>(2);
  std::vector<sim::RigidImpulse> impulses;

  TwoRows() {
    for (const int i : {4, 8}) {
      sim::RowPlace place;
      place.solids = {0, 1};
      place.cell = {i, 10, 10};
      contacts.places.push_back(place);
      system::ContactRow row;
      row.normal = Vec3d::UnitY();
      row.friction = 0.5;
      row.normal_impulse = 2.0;
      row.friction_impulse = Vec3d(1.0, 0.0, 0.0);
      contacts.rows.push_back(row);
    }
    for (solid::Momenta& body : momenta) body.mass = 1.0;
    momenta[0].center = Vec3d(0.3, 0.1, 0.2);
    momenta[1].center = Vec3d(0.1, 0.3, 0.2);
    sim::ContactPair record;
    record.one = 0, record.other = 1;
    info.contacts.push_back(record);
  }
  // coupling: along the normal of either row.
  void limit(double first, double second) {
    const sim::Scene scene{params, box, rests, emitters, forces, pins};
    const sim::StepContext step{parallel, scene, 0.0, 0.01, 0.01, profile, info};
    sim::ContactPair& record = info.contacts[0];
    record.normal_impulse = 4.0 + first + second;
    record.impulse = Vec3d(2.0, 4.0 + first + second, 0.0);
    sim::limit_pair_friction(step, states, holds, contacts, {first * Vec3d::UnitY(), second * Vec3d::UnitY()}, momenta,
                             impulses);
  }
  // What both get, about the origin.
  Vec3d angular() const {
    Vec3d sum = Vec3d::Zero();
    for (std::size_t l = 0; l < impulses.size(); ++l)
      sum += impulses[l].angular + momenta[l].center.cross(impulses[l].linear);
    return sum;
  }
};

}  // namespace

TEST_CASE("Friction that the pressure has left within Coulomb's cone is not touched") {
  TwoRows at_limit, pressed;
  at_limit.limit(0.0, 0.0);
  pressed.limit(1.0, 1.0);
  CHECK(at_limit.impulses.empty());
  CHECK(pressed.impulses.empty());
  CHECK(pressed.info.contacts[0].impulse == Vec3d(2.0, 6.0, 0.0));
}

TEST_CASE("What friction at a point of each surface turns two bodies by is given back", "[law]") {
  TwoRows s;
  for (sim::RowPlace& place : s.contacts.places) place.gap = -0.01, place.skin = 0.03;
  s.limit(0.0, 0.0);
  REQUIRE(s.impulses.size() == 2);
  for (const sim::RigidImpulse& impulse : s.impulses) {  // half of 0.02 n x R, R = (2, 0, 0)
    CHECK(impulse.linear.isZero(0));
    CHECK(impulse.angular.isApprox(Vec3d(0.0, 0.0, 0.02), 1e-12));
  }
  TwoRows on_wall;
  for (sim::RowPlace& place : on_wall.contacts.places) place.skin = 0.02;
  on_wall.holds.clusters[0].walls = 2;
  on_wall.limit(0.0, 0.0);
  CHECK(on_wall.impulses.empty());
}

TEST_CASE("Where the pressure unloads a contact its friction falls with it, and momentum is kept", "[law]") {
  TwoRows s;
  s.limit(-1.0, -1.0);  // 2 of 4 are left: friction 1 of 2
  REQUIRE(s.impulses.size() == 2);
  CHECK(s.impulses[1].linear.isApprox(Vec3d(-1.0, 0.0, 0.0), 1e-12));
  CHECK(s.impulses[0].linear.isApprox(Vec3d(1.0, 0.0, 0.0), 1e-12));
  CHECK(s.angular().norm() < 1e-12);
  CHECK(s.info.contacts[0].impulse.isApprox(Vec3d(1.0, 2.0, 0.0), 1e-12));
}

TEST_CASE("Rows that the pressure makes pull do not", "[law]") {
  TwoRows s;
  s.limit(-2.5, 0.0);  // the first pulls by 0.5
  REQUIRE(s.impulses.size() == 2);
  CHECK(s.impulses[1].linear.isApprox(Vec3d(-1.0, 0.5, 0.0), 1e-12));
  CHECK((s.impulses[0].linear + s.impulses[1].linear).norm() < 1e-12);
  CHECK(s.angular().norm() < 1e-12);
  CHECK(s.info.contacts[0].normal_impulse == Approx(2.0));
  CHECK(s.info.contacts[0].impulse.isApprox(Vec3d(1.0, 2.0, 0.0), 1e-12));
}

TEST_CASE("A collider feels nothing of it: the reaction of what moves it does", "[law]") {
  TwoRows s;
  sim::Pin pin;
  pin.solid = 0;
  pin.whole = true;
  s.pins.push_back(pin);
  s.info.pins.resize(1);
  s.info.pins[0].center = Vec3d(0.1, 0.1, 0.1);
  solid::SolidState& plate = s.states[0];
  plate.band.grid = s.box;
  plate.v.assign(s.box.node_count());
  std::fill(plate.v.c[0].begin(), plate.v.c[0].end(), Real(3));
  s.limit(-1.0, -1.0);
  REQUIRE(s.impulses.size() == 2);
  CHECK(s.impulses[0].linear == Vec3d::Zero());
  CHECK(s.impulses[1].linear.isApprox(Vec3d(-1.0, 0.0, 0.0), 1e-12));
  const sim::PinReaction& reaction = s.info.pins[0];
  CHECK(reaction.impulse.isApprox(Vec3d(-1.0, 0.0, 0.0), 1e-12));  // as on the body, through the collider
  const Vec3d x(0.13, 0.21, 0.21);                                 // the middle of both rows
  CHECK(reaction.angular_impulse.isApprox((x - reaction.center).cross(reaction.impulse), 1e-12));
  CHECK(reaction.work == Approx(-3.0));
}

TEST_CASE("A ball thrown at a clamped plate obeys Coulomb's law in every step, in fluid and in vacuum", "[law]") {
  const bool fluid = GENERATE(true, false);
  const double mu = GENERATE(0.1, 0.9);
  sim::Params p = still({0.6, 0.4, 0.4}, kCell, fluid);
  sim::SolidDesc plate = desc_of(block({0.3, 0.15, 0.2}, {0.24, 0.04, 0.1})), ball = ball_desc({0.25, 0.27, 0.2}, 0.06);
  plate.youngs_modulus = 4e4, ball.youngs_modulus = 4e4;
  plate.friction = ball.friction = mu;
  ball.density = 1500.0;
  ball.velocity = {1.0, -1.5, 0.0};
  auto s = make_simulation(p, {plate, ball});
  std::vector<std::uint8_t> ends;
  for (const Vec3d& x : plate.surface.points) ends.push_back(std::abs(x[0] - 0.3) > 0.23);
  s->add_pin(0, ends);
  double worst = 0.0, all = 0.0;
  while (s->state().time < 0.25) {
    const sim::StepInfo info = s->step(kFrame);
    for (const sim::ContactPair& pair : info.contacts) {
      all += pair.normal_impulse;
      worst = std::max(worst, (pair.impulse.norm() - 1e-9) / (std::hypot(1.0, mu) * pair.normal_impulse + 1e-12));
    }
  }
  INFO("mu " << mu << (fluid ? ", air" : ", vacuum") << ": " << worst << " of what friction allows, " << all << " N s");
  CHECK(all > 0.5 * s->diagnose_solid(1).mass * 1.5);
  CHECK(worst < 1.001);
}
