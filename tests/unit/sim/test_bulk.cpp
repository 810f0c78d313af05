// Purpose: laws of compressible solids whose bulk stiffness the pressure has (sim/bulk.hpp).
#include <cmath>

#include "unit/geometry/shapes.hpp"
#include "unit/sim/free_solid.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kPi = 3.14159265358979323846;

sim::Params vacuum(const Vec3d& size, double cell) {
  sim::Params p = box_params(size, cell);
  p.fluid.present = false;
  p.gravity.setZero();
  return p;
}

sim::SolidDesc described(geometry::TriangleMesh mesh) {
  sim::SolidDesc d;
  d.surface = std::move(mesh);
  return d;
}

Vec3d displacement(const sim::Simulation& s, const Vec3d& x) {
  const grid::Grid& g = s.state().solids[0].band.grid;
  const Vec3d at = (x - g.node_position(0, 0, 0)) / g.h;
  return s.state()
      .solids[0]
      .u
      .at(g.node(static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                 static_cast<int>(std::lround(at[2]))))
      .cast<double>();
}

}  // namespace

TEST_CASE("A bar with free sides strains by sigma / E and contracts by nu of it", "[law]") {
  // Pulled by a force beta x' per volume: sigma = beta/2 ((L/2)^2 - x'^2), in the middle all but uniaxial.
  const double nu = GENERATE(0.4, 0.49);
  constexpr double kCell = 0.0125, kModulus = 1e5, kStrain = 0.01, kLong = 0.6, dt = 0.005;
  sim::SolidDesc bar = described(geometry::shapes::box({0.1, 0.1, 0.1}, {0.7, 0.2, 0.2}));
  bar.youngs_modulus = kModulus;
  bar.poissons_ratio = nu;
  bar.compressible = true;
  bar.rayleigh_beta = 4 * dt;
  const auto s = make_simulation(vacuum({0.8, 0.3, 0.3}, kCell), {bar});
  const double beta = 8.0 * kStrain * kModulus / (kLong * kLong);
  load(*s, dt, 80, [&](const Vec3d& x, std::size_t a) { return a == 0 ? beta / 1000.0 * (x[0] - 0.4) : 0.0; });
  const double reach = 3 * kCell, wide = 3 * kCell;
  const double along = (displacement(*s, {0.4 + reach, 0.15, 0.15}) - displacement(*s, {0.4 - reach, 0.15, 0.15}))[0];
  const double across = (displacement(*s, {0.4, 0.15 + wide, 0.15}) - displacement(*s, {0.4, 0.15 - wide, 0.15}))[1];
  const double longer = 1.0 - along / (2 * reach), wider = 1.0 - across / (2 * wide);  // dX/dx
  const double strain = 1.0 / longer - 1.0, contraction = 1.0 - 1.0 / wider;
  const double exact = kStrain * (1.0 - 4.0 / 3.0 * reach * reach / (kLong * kLong));
  INFO("nu " << nu << ": strain " << strain << " of " << exact << ", contraction " << contraction / strain);
  CHECK(s->diagnose_solid(0).kinetic_energy < 1e-4 * s->diagnose_solid(0).elastic_energy);
  CHECK(strain == Approx(exact).epsilon(0.02));
  CHECK(contraction / strain == Approx(nu).epsilon(0.02));
}

TEST_CASE("A ball of Poisson's ratio 0.49 under a load towards its centre shrinks as elasticity says", "[law]") {
  // beta (x - c) per volume, nothing on the surface: u = -beta / (10 (lambda + 2 mu)) (C - r^2) (x - c),
  // C = R^2 (5 lambda + 6 mu) / (3 lambda + 2 mu). In the middle, where the volume shrinks most.
  constexpr double kCell = 0.0125, kRadius = 0.1, dt = 0.005, kStrain = 0.002, nu = 0.49, kModulus = 6e4;
  const double bulk = kModulus / (3.0 * (1.0 - 2.0 * nu)), beta = 5.0 * kStrain * bulk / (kRadius * kRadius);
  sim::SolidDesc ball = ball_desc(Vec3d::Constant(0.2), kRadius);
  ball.youngs_modulus = kModulus;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  ball.rayleigh_beta = dt;
  const auto s = make_simulation(vacuum(Vec3d::Constant(0.4), kCell), {ball});
  load(*s, dt, 60, [&](const Vec3d& x, std::size_t a) {
    const auto i = static_cast<Eigen::Index>(a);
    return -beta / 1000.0 * (x[i] - 0.2);
  });
  const auto now = s->diagnose_solid(0);
  const double mu = kModulus / (2.0 * (1.0 + nu)), lambda = bulk - 2.0 / 3.0 * mu, reach = 2 * kCell;
  const double size = kRadius * kRadius * (5.0 * lambda + 6.0 * mu) / (3.0 * lambda + 2.0 * mu);
  const double exact = beta / (10.0 * (lambda + 2.0 * mu)) * (size - reach * reach);
  const double shrunk = (displacement(*s, {0.2 - reach, 0.2, 0.2}) - displacement(*s, {0.2 + reach, 0.2, 0.2}))[0];
  INFO("shrinks by " << shrunk / (2 * reach) << " of " << exact);
  CHECK(now.kinetic_energy < 1e-3 * now.elastic_energy);
  CHECK(shrunk / (2 * reach) == Approx(exact).epsilon(0.2));  // docs/lab/bulk-by-pressure.md
}

TEST_CASE("A compressible ball of Poisson's ratio 0.4 breathes at the frequency of its radial mode", "[law]") {
  // x cot x = 1 - (c_p / c_s)^2 x^2 / 4, x = omega R / c_p.
  constexpr double kRadius = 0.1, kModulus = 6e4, nu = 0.4, kDensity = 1000.0;
  const double mu = kModulus / (2.0 * (1.0 + nu)), lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
  const double ratio = (lambda + 2.0 * mu) / mu;
  double low = 1.5, high = 3.1;
  for (int n = 0; n < 50; ++n) {
    const double x = 0.5 * (low + high);
    (x / std::tan(x) - 1.0 + 0.25 * ratio * x * x > 0.0 ? low : high) = x;
  }
  const double period = 2.0 * kPi * kRadius / (low * std::sqrt((lambda + 2.0 * mu) / kDensity));
  sim::SolidDesc ball = ball_desc(Vec3d::Constant(0.2), kRadius);
  ball.youngs_modulus = kModulus;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  const auto s = make_simulation(vacuum(Vec3d::Constant(0.4), 0.0125), {ball});
  stretch(*s, Vec3d::Constant(0.2), Vec3d::Constant(1.01));
  const auto grown = [&] {
    const auto d = s->diagnose_solid(0);
    return d.volume_mesh / d.rest_volume - 1.0;
  };
  const double start = s->diagnose_solid(0).elastic_energy;
  const std::vector<double> crossings = sign_changes(*s, period, 60.0, grown, [&] {
    const auto d = s->diagnose_solid(0);
    CHECK(d.kinetic_energy + d.elastic_energy < 1.1 * start);
  });
  REQUIRE(crossings.size() == 3);
  const auto end = s->diagnose_solid(0);
  INFO("period " << crossings[2] - crossings[0] << " s, exact " << period << " s, energy kept "
                 << (end.kinetic_energy + end.elastic_energy) / start);
  CHECK(crossings[2] - crossings[0] == Approx(period).epsilon(0.07));
}

TEST_CASE("A compressible ball of Poisson's ratio 0.49 swings at the frequency of Lamb's spheroidal mode", "[law]") {
  // omega R / c_s = 2.6597 for l = 2 at 0.49.
  constexpr double kRadius = 0.1, kShear = 1e4, nu = 0.49;
  const double period = 2.0 * kPi * kRadius / (2.6597 * std::sqrt(kShear / 1000.0));
  sim::SolidDesc ball = ball_desc(Vec3d::Constant(0.2), kRadius);
  ball.youngs_modulus = 2.0 * (1.0 + nu) * kShear;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  const auto s = make_simulation(vacuum(Vec3d::Constant(0.4), kRadius / 7), {ball});
  stretch(*s, Vec3d::Constant(0.2), {1.05, 1.0 / std::sqrt(1.05), 1.0 / std::sqrt(1.05)});
  const double start = s->diagnose_solid(0).elastic_energy, rest = elongation(s->solids()[0].surface.points);
  const std::vector<double> crossings = sign_changes(
      *s, period, 40.0, [&] { return elongation(s->state().solids[0].surface) - rest; }, [] {});
  REQUIRE(crossings.size() == 3);
  const auto end = s->diagnose_solid(0);
  const double kept = (end.kinetic_energy + end.elastic_energy) / start;
  INFO("period " << crossings[2] - crossings[0] << " s, exact " << period << " s, energy kept " << kept);
  CHECK(crossings[2] - crossings[0] == Approx(period).epsilon(0.07));
  CHECK(kept > 0.15);  // damped: the step does not resolve pressure waves
  CHECK(kept < 1.0);
}
