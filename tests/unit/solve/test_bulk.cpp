// Purpose: laws of compressible solids whose bulk stiffness the pressure has (solve/bulk.hpp).
#include <cmath>

#include "unit/geometry/shapes.hpp"
#include "unit/sim/free_solid.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

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

TEST_CASE("A bar with free sides strains by sigma / E and contracts by nu of it", "[law][slow]") {
  // Pulled by a force beta x' per volume: sigma = beta/2 ((L/2)^2 - x'^2), in the middle all but uniaxial, and
  // 5/6 of the strain more there, since the force grows as the bar becomes longer.
  const double nu = GENERATE(0.4, 0.49);
  constexpr double kCell = 0.0125, kModulus = 1e5, kStrain = 0.01, kLong = 0.6, dt = 0.005;
  sim::SolidDesc bar = desc_of(geometry::shapes::box({0.1, 0.1, 0.1}, {0.7, 0.2, 0.2}));
  bar.youngs_modulus = kModulus;
  bar.poissons_ratio = nu;
  bar.compressible = true;
  bar.rayleigh_beta = 4 * dt;
  const auto s = make_simulation(still_vacuum({0.8, 0.3, 0.3}, kCell), {bar});
  const double beta = 8.0 * kStrain * kModulus / (kLong * kLong);
  load(*s, dt, 80, [&](const Vec3d& x, std::size_t a) { return a == 0 ? beta / 1000.0 * (x[0] - 0.4) : 0.0; });
  const double reach = 3 * kCell, wide = 3 * kCell;
  const double along = (displacement(*s, {0.4 + reach, 0.15, 0.15}) - displacement(*s, {0.4 - reach, 0.15, 0.15}))[0];
  const double across = (displacement(*s, {0.4, 0.15 + wide, 0.15}) - displacement(*s, {0.4, 0.15 - wide, 0.15}))[1];
  const double longer = 1.0 - along / (2 * reach), wider = 1.0 - across / (2 * wide);  // dX/dx
  const double strain = 1.0 / longer - 1.0, contraction = 1.0 - 1.0 / wider;
  const double exact = kStrain * (1.0 + 5.0 / 6.0 * kStrain - 4.0 / 3.0 * reach * reach / (kLong * kLong));
  INFO("nu " << nu << ": strain " << strain << " of " << exact << ", contraction " << contraction / strain);
  CHECK(s->diagnose_solid(0).kinetic_energy < 1e-4 * s->diagnose_solid(0).elastic_energy);
  CHECK(strain == Approx(exact).epsilon(0.02));
  CHECK(contraction / strain == Approx(nu).epsilon(0.02));
}

namespace {

struct Shrunk {
  double middle, surface;  // over what is exact: displacement within 0.7 R, mean over all directions; loss of volume
};

// A ball under a force -beta (x - c) per volume, nothing on the surface:
// u = -beta / (10 (lambda + 2 mu)) (C - r^2) (x - c), C = R^2 (5 lambda + 6 mu) / (3 lambda + 2 mu).
Shrunk shrink(double nu, double across) {
  constexpr double kRadius = 0.1, kModulus = 6e4, kStrain = 0.002, dt = 0.005;  // kStrain: loss of volume
  const Vec3d center = Vec3d::Constant(0.2);
  const double bulk = kModulus / (3.0 * (1.0 - 2.0 * nu)), beta = 5.0 * kStrain * bulk / (kRadius * kRadius);
  sim::SolidDesc ball = ball_desc(center, kRadius);
  ball.surface = ball_mesh(center, kRadius, 32);
  ball.youngs_modulus = kModulus;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  ball.rayleigh_beta = dt;
  sim::Params p = still_vacuum(Vec3d::Constant(0.4), 2.0 * kRadius / across);
  p.numerics.damping_by_pace = false;  // the load comes as a velocity, on which no stiffness may act
  const auto s = make_simulation(p, {ball});
  load(*s, dt, 60, [&](const Vec3d& x, std::size_t a) {
    const auto i = static_cast<Eigen::Index>(a);
    return -beta / 1000.0 * (x[i] - center[i]);
  });
  const auto now = s->diagnose_solid(0);
  CHECK(now.kinetic_energy < 1e-6 * now.elastic_energy);
  const double mu = kModulus / (2.0 * (1.0 + nu)), lambda = bulk - 2.0 / 3.0 * mu;
  const double size = kRadius * kRadius * (5.0 * lambda + 6.0 * mu) / (3.0 * lambda + 2.0 * mu);
  const grid::Grid& g = s->state().solids[0].band.grid;
  double found = 0.0, exact = 0.0;
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const auto [i, j, k] = g.node_place(n);
    const Vec3d x = g.node_position(i, j, k) - center;
    const double r = x.norm();
    if (r > 0.7 * kRadius || r < 0.1 * kRadius) continue;
    found += s->state().solids[0].u.at(n).cast<double>().dot(x) / (r * r);
    exact -= beta / (10.0 * (lambda + 2.0 * mu)) * (size - r * r);
  }
  return {found / exact, (1.0 - now.volume_mesh / now.rest_volume) / kStrain};
}

}  // namespace

TEST_CASE("A ball under a load towards its centre shrinks as elasticity says, to second order at its surface",
          "[law][nightly]") {
  const double nu = GENERATE(0.4, 0.49);
  const Shrunk coarse = shrink(nu, 10), fine = shrink(nu, 20);
  INFO("nu " << nu << ": 10 cells across " << coarse.middle << ", surface " << coarse.surface << "; 20 " << fine.middle
             << ", " << fine.surface << " of what is exact");
  CHECK(coarse.middle == Approx(1.0).margin(0.045));  // (h/R)^2: of the stairs, since the middle has its own stiffness
  CHECK(fine.middle == Approx(1.0).margin(0.01));
  CHECK((coarse.middle - 1.0) / (fine.middle - 1.0) > 3.4);
  CHECK(fine.surface == Approx(1.0).margin(nu < 0.45 ? 0.02 : 0.06));
  CHECK((coarse.surface - 1.0) / (fine.surface - 1.0) > 3.4);
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
  const double period = 2.0 * M_PI * kRadius / (low * std::sqrt((lambda + 2.0 * mu) / kDensity));
  sim::SolidDesc ball = ball_desc(Vec3d::Constant(0.2), kRadius);
  ball.youngs_modulus = kModulus;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.4), 0.0125), {ball});
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
  // Radial modes: omega R / c_p, their parts of the energy of a uniform growth, and what of theirs the pressure has,
  // which is taken at the end of a step (backward Euler).
  constexpr double kModes[][3] = {{2.8966, 0.6828, 0.598}, {6.1737, 0.1276, 0.518}, {9.3531, 0.0543, 0.508},
                                  {12.513, 0.0301, 0.504}, {15.665, 0.0191, 0.503}, {18.814, 0.0132, 0.502}};
  double damped = 0.0;
  for (const auto& [root, part, share] : kModes) {
    const double angle = root / low * 2.0 * M_PI / 60.0;
    damped += part * std::pow(1.0 + share * angle * angle, -static_cast<double>(s->state().steps));
  }
  const double kept = (end.kinetic_energy + end.elastic_energy) / start;
  INFO("period " << crossings[2] - crossings[0] << " s, exact " << period << " s, energy kept " << kept
                 << ", by backward Euler of the pressure " << damped);
  CHECK(crossings[2] - crossings[0] == Approx(period).epsilon(0.03));
  CHECK(kept == Approx(damped).epsilon(0.08));
}

TEST_CASE("A compressible ball of Poisson's ratio 0.49 swings at the frequency of Lamb's spheroidal mode",
          "[law][nightly]") {
  // Modes l = 2 at 0.49: omega R / c_s, and their parts of the energy of a uniform stretch at constant volume.
  constexpr double kModes[][2] = {{2.66483, 0.6502}, {5.4539, 0.2271}, {8.8678, 0.0443}, {12.154, 0.0195},
                                  {15.380, 0.0113},  {18.578, 0.0074}, {21.758, 0.0053}, {24.929, 0.0039}};
  constexpr double kRadius = 0.1, kShear = 1e4, nu = 0.49;
  const double steps = GENERATE(40.0, 160.0);  // in a period: backward Euler; nearly the trapezoidal rule
  const double shear_speed = std::sqrt(kShear / 1000.0), period = 2.0 * M_PI * kRadius / (kModes[0][0] * shear_speed);
  sim::SolidDesc ball = ball_desc(Vec3d::Constant(0.2), kRadius);
  ball.youngs_modulus = 2.0 * (1.0 + nu) * kShear;
  ball.poissons_ratio = nu;
  ball.compressible = true;
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.4), kRadius / 7), {ball});
  stretch(*s, Vec3d::Constant(0.2), {1.05, 1.0 / std::sqrt(1.05), 1.0 / std::sqrt(1.05)});
  const double start = s->diagnose_solid(0).elastic_energy, rest = elongation(s->solids()[0].surface.points);
  const std::vector<double> crossings = sign_changes(
      *s, period, steps, [&] { return elongation(s->state().solids[0].surface) - rest; }, [] {});
  REQUIRE(crossings.size() == 3);
  const auto end = s->diagnose_solid(0);
  const double kept = (end.kinetic_energy + end.elastic_energy) / start;
  double damped = 0.0;  // what backward Euler keeps
  for (const auto& [root, part] : kModes) {
    const double angle = root * shear_speed / kRadius * period / steps;
    damped += part * std::pow(1.0 + angle * angle, -static_cast<double>(s->state().steps));
  }
  INFO(steps << " steps: period " << crossings[2] - crossings[0] << " s, exact " << period << " s, energy kept " << kept
             << ", by backward Euler " << damped);
  CHECK(crossings[2] - crossings[0] == Approx(period).epsilon(steps < 100 ? 0.05 : 0.03));
  if (steps < 100) {
    CHECK(kept == Approx(damped).epsilon(0.05));
  } else {
    CHECK(kept > 0.95);
    CHECK(kept < 1.0);
  }
}
