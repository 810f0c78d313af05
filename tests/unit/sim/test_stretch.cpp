// Purpose: solids that are stretched where they start.
#include <algorithm>

#include "base/error.hpp"
#include "material/constitutive.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using Catch::Matchers::Contains;
using test::ball_desc;
using test::kBallRadius;
using test::kCell;
using test::make_simulation;
using test::still_vacuum;

namespace {

const Vec3d kBallCenter(0.31, 0.29, 0.3);

sim::SolidDesc stretched_ball(const Vec3d& stretch, bool compressible = false) {
  sim::SolidDesc d = ball_desc(kBallCenter, kBallRadius);
  d.stretch = stretch;
  d.compressible = compressible;
  return d;
}

// Largest distance of the surface from the shape at rest, moved along with its centre.
double off_rest(sim::Simulation& s) {
  const Vec3d center = s.diagnose_solid(0).center;
  const auto& rest = s.solids()[0].surface.points;
  const auto& now = s.state().solids[0].surface;
  double most = 0.0;
  for (std::size_t i = 0; i < rest.size(); ++i) most = std::max(most, (now[i] - center - rest[i] + kBallCenter).norm());
  return most;
}

}  // namespace

TEST_CASE("Stretch: a solid starts stretched about its centre, with the energy of that strain") {
  const double kVolume = 4.0 / 3.0 * 3.14159265358979 * kBallRadius * kBallRadius * kBallRadius;
  for (const Vec3d& stretch :
       {Vec3d(1.3, 0.8, 1.1), Vec3d(0.6, 0.6, 0.6), Vec3d(std::sqrt(2.0), 0.5, std::sqrt(2.0))}) {
    const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {stretched_ball(stretch, true)});
    const auto& rest = s->solids()[0];
    for (std::size_t i = 0; i < rest.surface.points.size(); ++i) {
      const Vec3d wanted = kBallCenter + stretch.cwiseProduct(rest.surface.points[i] - kBallCenter);
      CHECK((s->state().solids[0].surface[i] - wanted).norm() < 1e-6 * kBallRadius);
    }
    s->step(1e-7);
    const sim::SolidDiagnostics d = s->diagnose_solid(0);
    const double energy = material::principal_response(rest.elastic, stretch).energy;
    CHECK(d.elastic_energy == Approx(kVolume * energy).epsilon(0.03));
    CHECK(d.mass == Approx(rest.density * kVolume).epsilon(0.02));
    CHECK(d.volume_mesh == Approx(stretch.prod() * rest.volume).epsilon(1e-4));
    CHECK(d.rest_volume == Approx(kVolume).epsilon(0.02));
    CHECK((d.center - kBallCenter).norm() < 0.02 * kCell);
  }
}

TEST_CASE("Stretch: damped, a solid comes back to its shape in steps of 1/20 s", "[law]") {
  for (const bool compressible : {false, true}) {
    sim::SolidDesc ball =
        stretched_ball(compressible ? Vec3d(0.7, 0.7, 0.7) : Vec3d(1.2, 1.0 / 1.44, 1.2), compressible);
    ball.rayleigh_alpha = 20.0;
    ball.rayleigh_beta = 0.005;
    const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball});
    CHECK(off_rest(*s) > 0.15 * kBallRadius);
    for (int i = 0; i < 12; ++i) s->advance(0.05, {});
    INFO("compressible " << compressible);
    CHECK(off_rest(*s) < 1e-3 * kBallRadius);
  }
}

TEST_CASE("Stretch: of one nothing changes a bit") {
  const auto plain = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball_desc(kBallCenter)});
  const auto one = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {stretched_ball(Vec3d::Ones())});
  plain->advance(0.05, {});
  one->advance(0.05, {});
  CHECK(sim::state_hash(plain->state()) == sim::state_hash(one->state()));
}

TEST_CASE("Stretch: passengers ride along from the start") {
  const Vec3d stretch(1.3, 0.8, 1.1), eye = kBallCenter + Vec3d(0.05, 0.06, 0.03);
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {stretched_ball(stretch)});
  const std::size_t id = s->add_passenger(0, {eye});
  std::vector<Vec3d> now, velocity;
  s->locate_passenger(id, now, velocity);
  CHECK((now[0] - kBallCenter - stretch.cwiseProduct(eye - kBallCenter)).norm() < 1e-3 * kCell);
}

TEST_CASE("Stretch: what is refused") {
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)));
  geometry::MeshReport report;
  const auto add = [&](const sim::SolidDesc& d) { s->add_solid(d, report); };
  CHECK_THROWS_WITH(add(stretched_ball({1, 0.1, 1})), Contains("stretch = 0.1: must be between 0.2 and 5"));
  CHECK_THROWS_WITH(add(stretched_ball({0.4, 0.4, 0.4})), Contains("product = 0.064: must be between 0.1 and 10"));
  CHECK_THROWS_WITH(add(stretched_ball({4, 1, 1})), Contains("the domain from"));
  add(stretched_ball({1.5, 1, 1}));
  sim::SolidDesc near = ball_desc(kBallCenter + Vec3d(0.2, 0, 0), 0.08);
  CHECK_THROWS_WITH(add(near), Contains("overlaps solid 1"));
  CHECK_THROWS_WITH(s->add_pin(0, std::vector<std::uint8_t>(s->solids()[0].surface.points.size(), 1)),
                    Contains("must hold a solid that starts in its shape at rest"));
}
