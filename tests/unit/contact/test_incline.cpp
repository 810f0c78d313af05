// Purpose: a block on a collider that is tilted off the axes, in vacuum: Coulomb's law, where it begins to slide,
// creep.
#include <Eigen/Geometry>

#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

struct TiltedBlock {
  Vec3d downhill;
  double tilt;  // rad
  SimulationPtr s;

  // turn: of a level plate. The block, 8 x 4 x 8 cells, lies along the plate's axes.
  TiltedBlock(const Vec3d& turn, double mu, bool compressible) : s(make_simulation(vacuum({0.9, 0.7, 0.9}, kCell))) {
    const Mat3d axes = solid::rotation(turn);
    const Vec3d normal = axes.col(1), middle(0.45, 0.25, 0.45);  // of the plate's upper face
    tilt = std::acos(normal[1]);
    downhill = (normal[1] * normal - Vec3d::UnitY()).normalized();
    const auto turned = [&](const Vec3d& center, const Vec3d& half) {
      geometry::TriangleMesh mesh = block(Vec3d::Zero(), half);
      for (Vec3d& x : mesh.points) x = center + axes * x;
      return mesh;
    };
    geometry::MeshReport report;
    sim::SolidDesc plate = desc_of(turned(middle - 0.1 * normal, {0.9, 0.1, 0.9}));
    plate.friction = mu;
    s->add_collider(plate, report);
    sim::SolidDesc body = desc_of(turned(middle - 0.12 * downhill + 0.04 * normal, {0.08, 0.04, 0.08}));
    body.friction = mu;
    body.youngs_modulus = 2e5;
    body.compressible = compressible;
    s->add_solid(body, report);
  }
  double speed() {
    const sim::SolidDiagnostics d = s->diagnose_solid(1);
    return d.momentum.dot(downhill) / d.mass;
  }
  // Mean over ten frames, after four in which it lands [m/s^2].
  double acceleration() {
    for (int frame = 0; frame < 4; ++frame) s->advance(kFrame, {});
    const double first = speed(), begin = s->state().time;
    for (int frame = 0; frame < 10; ++frame) s->advance(kFrame, {});
    return (speed() - first) / (s->state().time - begin);
  }
  // Largest move of the centre in one of the last six of 36 frames [cells].
  double creep() {
    double most = 0.0;
    for (int frame = 0; frame < 36; ++frame) {
      const Vec3d before = s->diagnose_solid(1).center;
      s->advance(kFrame, {});
      if (frame >= 30) most = std::max(most, (s->diagnose_solid(1).center - before).norm() / kCell);
    }
    return most;
  }
};

double coulomb(double tilt, double mu) { return kGravity * (std::sin(tilt) - mu * std::cos(tilt)); }

// For a block on a collider turned by this.
void check_threshold(const Vec3d& turn, bool compressible) {
  const double slope = std::tan(TiltedBlock(turn, 0.0, false).tilt);
  TiltedBlock slides(turn, slope - 0.02, compressible), sticks(turn, slope + 0.02, compressible);
  const double found = slides.acceleration(), wanted = coulomb(slides.tilt, slope - 0.02), creep = sticks.creep();
  INFO("turned by " << turn.transpose() << ", slope " << slope << (compressible ? ", compressible" : "")
                    << ": slides at " << found << " m/s^2, Coulomb's " << wanted << "; sticks with a creep of " << creep
                    << " cells per frame");
  CHECK(found > 0.5 * wanted);
  CHECK(creep < (compressible ? 4e-3 : 1e-2));
}

}  // namespace

TEST_CASE("A block slides down a collider tilted about any axis as Coulomb says", "[law][nightly]") {
  struct Case {
    Vec3d turn;
    double mu;
    bool compressible;
  };
  const auto c = GENERATE(Case{{0.3, 0.0, 0.0}, 0.15, false}, Case{{0.2, 0.5, -0.4}, 0.3, false},
                          Case{{-0.25, 0.3, 0.3}, 0.2, true});
  TiltedBlock body(c.turn, c.mu, c.compressible);
  const double found = body.acceleration(), wanted = coulomb(body.tilt, c.mu);
  INFO("turned by " << c.turn.transpose() << ", tilt " << body.tilt << " rad, mu " << c.mu
                    << (c.compressible ? ", compressible" : "") << ": " << found << " m/s^2, Coulomb's " << wanted);
  CHECK(found == Approx(wanted).epsilon(0.025));
}

TEST_CASE("A block on a tilted collider slides from 0.02 of friction below the slope on, and sticks 0.02 above",
          "[law][nightly]") {
  check_threshold({0.0, 0.0, -0.35}, GENERATE(true, false));
}

TEST_CASE("A block on a collider tilted about any axis slides from 0.02 below the slope on, and sticks 0.02 above",
          "[law][nightly]") {
  check_threshold({0.2, 0.5, -0.4}, GENERATE(true, false));
}
