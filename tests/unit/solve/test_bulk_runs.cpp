// Purpose: bulk stiffness by the pressure (solve/bulk.hpp) together with what else a run has: the ledger, checkpoints,
// threads, fluid around, plastic flow.
#include <filesystem>
#include <random>

#include "record/energy_ledger.hpp"
#include "record/step_record.hpp"
#include "unit/sim/free_solid.hpp"

using namespace efsi;
using namespace efsi::test;
namespace fs = std::filesystem;

namespace {

sim::SolidDesc bulky_ball(const Vec3d& center, double nu, double shear = 1e4, double radius = 0.1) {
  sim::SolidDesc d = ball_desc(center, radius);
  d.youngs_modulus = 2.0 * (1.0 + nu) * shear;
  d.poissons_ratio = nu;
  d.compressible = true;
  return d;
}

}  // namespace

TEST_CASE("Ledger: the work of the pressure is what the bulk stiffness gives, and all columns join", "[law][slow]") {
  // A ball that breathes in its first radial mode, u as sin x / x^2 - cos x / x, x = 3.08 r / R (as in test_bulk.cpp,
  // of lambda = 49 mu), for the quarter of a period in which it comes back from 1.01 of its size. A part that vanishes
  // with the step backward Euler takes, one that vanishes with the cell the reading of the dilatation between its
  // nodes.
  constexpr double nu = 0.49, kShear = 1e4, kRadius = 0.1, kRoot = 3.08;
  sim::Params p = still_vacuum(Vec3d::Constant(0.4), 0.0125);
  p.energy_ledger = true;
  p.numerics.pressure_tolerance = 1e-3;  // the work is that of the divergence that is asked for
  const auto s = make_simulation(p, {bulky_ball(Vec3d::Constant(0.2), nu)});
  const auto mode = [](double x) { return x > 1e-3 ? std::sin(x) / (x * x) - std::cos(x) / x : x / 3.0; };
  const auto u = band_field(*s, [&](std::size_t, const Vec3d& x, std::size_t a) {
    const Vec3d arm = x - Vec3d::Constant(0.2);
    const double r = std::max(1e-6, arm.norm());
    return 0.01 * kRadius * mode(kRoot * r / kRadius) / mode(kRoot) * arm[static_cast<Eigen::Index>(a)] / r;
  });
  s->set_solid_field(0, false, u.data());
  const double lambda = 2.0 * kShear * nu / (1.0 - 2.0 * nu);
  const double quarter = 0.5 * M_PI / kRoot * kRadius / std::sqrt((lambda + 2.0 * kShear) / 1000.0);
  const double start = s->diagnose_solid(0).elastic_energy;
  sim::Energy sum;
  double work = 0.0, last = 0.0;
  constexpr int kSteps = 160;
  for (int n = 0; n < kSteps; ++n) {
    s->step(quarter / kSteps);
    const sim::EnergyRecord& energy = *s->last_step().energy;
    sim::Energy step;
    for (const sim::Energy& column : energy.change) step += column;
    if (n > 0) CHECK((energy.at_end - step).sum() == Approx(last).epsilon(1e-5));  // nothing happens between two steps
    last = energy.at_end.sum();
    sum += step;
    work += energy.source_work;
  }
  const auto end = s->diagnose_solid(0);
  INFO("elastic " << start << " to " << end.elastic_energy << " J, kinetic " << end.kinetic_energy << " J, work "
                  << work << " J");
  CHECK(std::abs(sum.elastic - (end.elastic_energy - start)) < 1e-3 * start);
  CHECK(std::abs(sum.solid_kinetic - end.kinetic_energy) < 1e-3 * start);
  CHECK(end.elastic_energy < 0.3 * start);  // it has come back
  CHECK(work / (start - end.elastic_energy) == Approx(0.95).margin(0.05));
}

TEST_CASE("A compressible ball in a closed box of liquid keeps its volume and presses, in an open one it grows back",
          "[law][slow]") {
  const double nu = GENERATE(0.4, 0.49);
  constexpr double kShear = 1e4, kSize = 0.99;
  const double bulk = 2.0 * kShear * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu));
  for (const bool open : {false, true}) {
    sim::Params p = still(Vec3d::Constant(0.4));
    p.fluid.density = 100.0;
    if (open) p.walls.face[3] = grid::Wall::kOpen;
    const auto s = make_simulation(p, {bulky_ball(Vec3d::Constant(0.2), nu)});
    stretch(*s, Vec3d::Constant(0.2), Vec3d::Constant(kSize));
    const auto start = s->diagnose_solid(0);
    double most = start.elastic_energy;
    for (int n = 0; n < 60; ++n) {
      s->step(0.005);
      const auto now = s->diagnose_solid(0);
      most = std::max(most, now.elastic_energy + now.kinetic_energy + s->diagnose_fluid().kinetic_energy);
    }
    const auto now = s->diagnose_solid(0);
    const grid::Grid& g = s->grid();
    const double pressure = static_cast<double>(s->pressure()[g.padded(1, 1, 1)]),
                 wanted = bulk * (1.0 - std::pow(kSize, 3));
    INFO("nu " << nu << (open ? ", open" : ", closed") << ": volume " << now.volume_mesh / now.rest_volume
               << ", pressure " << pressure / wanted << " of K times the loss, energy at most "
               << most / start.elastic_energy << ", kept " << now.elastic_energy / start.elastic_energy);
    CHECK(most < 1.01 * start.elastic_energy);
    CHECK(now.volume_mesh / now.rest_volume == Approx(open ? 1.0 : std::pow(kSize, 3)).margin(1.5e-3));
    if (!open) CHECK(pressure == Approx(wanted).epsilon(0.05));
    if (open) CHECK(now.elastic_energy < 0.01 * start.elastic_energy);
  }
}

TEST_CASE("A compressible ball falls in a liquid a tenth as heavy as one that keeps its volume does", "[law]") {
  const double nu = GENERATE(0.4, 0.49);
  const auto fall = [&](bool compressible) {
    sim::Params p = box_params({0.6, 0.8, 0.6}, 0.02);
    p.fluid.density = 100.0;
    sim::SolidDesc ball = bulky_ball({0.3, 0.5, 0.3}, nu);
    ball.compressible = compressible;
    const auto s = make_simulation(p, {ball});
    for (int n = 0; n < 20; ++n) s->step(0.005);
    const auto d = s->diagnose_solid(0);
    CHECK(d.volume_mesh == Approx(d.rest_volume).epsilon(3e-3));
    return -d.momentum[1] / d.mass / 0.1;
  };
  const double found = fall(true), kept = fall(false), wanted = 9.8 * 0.9 / 1.05;  // added mass of a half
  INFO("nu " << nu << ": acceleration " << found << ", volume kept " << kept << ", unbounded " << wanted << " m/s^2");
  CHECK(found == Approx(kept).epsilon(0.01));
  CHECK(found == Approx(wanted).epsilon(0.03));
}

TEST_CASE("A compressible ball of Poisson's ratio 0.45 that yields keeps the stretch that is not elastic", "[law]") {
  // As test_plasticity.cpp has it for a ball that keeps its volume: what flows has none.
  constexpr double kShear = 1e4, kYield = 3000.0, kStretch = 1.4;
  double low = 1.0, high = 1.5;  // elastic stretch at the yield stress
  for (int n = 0; n < 60; ++n) {
    const double e = 0.5 * (low + high);
    (2.0 * kShear * (e * e - e - 1.0 / e + 1.0 / std::sqrt(e)) > kYield ? high : low) = e;
  }
  sim::Params p = still_vacuum(Vec3d::Constant(0.6));
  sim::SolidDesc ball = bulky_ball(Vec3d::Constant(0.3), 0.45);
  ball.plastic = {kYield, 1e6, 0.0};
  ball.rayleigh_beta = 0.003;
  const auto s = make_simulation(p, {ball});
  const double across = 1.0 / std::sqrt(kStretch);
  stretch(*s, Vec3d::Constant(0.3), {kStretch, across, across});
  for (int n = 0; n < 100; ++n) s->step(0.01);
  const auto d = s->diagnose_solid(0);
  const double length = (d.extent_max[0] - d.extent_min[0]) / 0.2;
  INFO("length " << length << " for " << kStretch / low << ", volume " << d.volume_mesh / d.rest_volume);
  CHECK(length == Approx(kStretch / low).epsilon(0.02));
  CHECK(d.volume_mesh == Approx(d.rest_volume).epsilon(0.01));
  CHECK(d.max_plastic_strain == Approx(std::log(kStretch / low)).epsilon(0.05));
}
