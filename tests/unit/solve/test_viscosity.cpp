// Viscosity of the fluid, walls that move, inflow: flows with a closed form, and the lid-driven cavity.
#include <algorithm>
#include <array>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using grid::Wall;

namespace {

// A channel along x in a slab: `cells` across y, periodic along x.
sim::Params channel(int cells, double h, double density, double viscosity, Wall wall) {
  sim::Params p = box_params({8 * h, cells * h, h}, h);
  p.gravity = Vec3d::Zero();
  p.fluid.density = density;
  p.fluid.viscosity = viscosity;
  p.walls.face = {Wall::kPeriodic, Wall::kPeriodic, wall, wall, Wall::kSlip, Wall::kSlip};
  return p;
}

// v_x along y in the middle of the box.
std::vector<double> profile(const sim::Simulation& s) {
  const grid::Grid& g = s.grid();
  std::vector<double> u;
  for (int j = 0; j <= g.cells[1]; ++j)
    u.push_back(static_cast<double>(s.state().fluid.velocity.c[0][g.node(g.cells[0] / 2, j, 0)]));
  return u;
}

void run(sim::Simulation& s, double time, double step) {
  const int steps = static_cast<int>(std::lround(time / step));
  for (int i = 0; i < steps; ++i) s.advance(step, {});
}

}  // namespace

TEST_CASE("A force drives a channel's fluid to the parabola of plane Poiseuille flow", "[viscosity][law]") {
  const int cells = GENERATE(12, 25);
  const double h = 0.3 / cells, density = 1.3, viscosity = 0.06, acceleration = 0.8;
  const auto s = make_simulation(channel(cells, h, density, viscosity, Wall::kNoSlip));
  sim::ForceField force;
  force.from_world.topLeftCorner<3, 3>() *= 0.01;  // everywhere
  force.acceleration = {acceleration, 0, 0};
  force.end_time = 1e9;
  s->add_force(force);
  run(*s, 4.0, 0.05);
  const std::vector<double> u = profile(*s);
  const double middle = acceleration * density * 0.3 * 0.3 / (8.0 * viscosity);
  double worst = 0.0;
  for (int j = 0; j <= cells; ++j) {
    const double y = j * h;
    worst = std::max(worst, std::abs(u[static_cast<std::size_t>(j)] - 4.0 * middle * y * (0.3 - y) / 0.09));
  }
  INFO("in the middle " << u[static_cast<std::size_t>(cells / 2)] << ", exact " << middle);
  CHECK(worst < 0.01 * middle);
}

// v_x = U cos(pi y / H) between slip walls falls by the rate nu (pi / H)^2: the walls are free of shear.
TEST_CASE("A shear layer decays at the rate of its viscosity", "[viscosity][law]") {
  const auto [cells, density, viscosity] =
      GENERATE(std::tuple{20, 1.0, 0.02}, std::tuple{31, 700.0, 5.0}, std::tuple{16, 1000.0, 60.0});
  const double h = 0.4 / cells, wave = 3.14159265358979 / 0.4, rate = viscosity / density * wave * wave;
  sim::Params p = channel(cells, h, density, viscosity, Wall::kSlip);
  p.energy_ledger = true;
  const auto s = make_simulation(p);
  const grid::Grid& g = s->grid();
  std::vector<float> v(3 * g.node_count(), 0.0f);
  for (std::size_t n = 0; n < g.node_count(); ++n)
    v[n] = static_cast<float>(0.3 * std::cos(wave * h * g.node_place(n)[1]));
  s->set_velocity(v.data());
  const double before = s->diagnose_fluid().kinetic_energy, step = 0.006 / rate;
  double booked = 0.0;
  for (int i = 0; i < 100; ++i) {
    const sim::StepInfo info = s->step(step);
    REQUIRE(info.energy);
    const double change = info.energy->change[static_cast<std::size_t>(sim::EnergyStage::kViscosity)].sum();
    CHECK(change < 0.0);
    booked += change;
  }
  const double left = profile(*s).front() / 0.3, after = s->diagnose_fluid().kinetic_energy;
  INFO("left " << left << ", exact " << std::exp(-0.6));
  CHECK(std::log(left) == Approx(-0.6).epsilon(0.01));
  CHECK(after < before);
  CHECK(booked == Approx(after - before).epsilon(0.02));
}

TEST_CASE("What a viscous step errs falls with the square of the step", "[viscosity][law]") {
  const int cells = 24;
  const double h = 0.4 / cells, wave = 3.14159265358979 / 0.4, viscosity = 5.0, density = 700.0;
  const double rate = viscosity / density * 4.0 / (h * h) * std::pow(std::sin(0.5 * wave * h), 2);  // of the cells
  const auto error = [&](int steps) {
    const auto s = make_simulation(channel(cells, h, density, viscosity, Wall::kSlip));
    const grid::Grid& g = s->grid();
    std::vector<float> v(3 * g.node_count(), 0.0f);
    for (std::size_t n = 0; n < g.node_count(); ++n)
      v[n] = static_cast<float>(0.003 * std::cos(wave * h * g.node_place(n)[1]));
    s->set_velocity(v.data());
    const double step = 1.0 / (rate * steps);
    for (int i = 0; i < steps; ++i) REQUIRE(s->step(step).dt == Approx(step));
    return std::abs(profile(*s).front() / 0.003 - std::exp(-1.0));
  };
  const double coarse = error(4), fine = error(8);
  INFO(coarse << ", " << fine);
  CHECK(coarse < 0.01);
  CHECK(fine < coarse / 3.0);
}

TEST_CASE("Walls that move apart drag the fluid to a straight profile", "[viscosity][law]") {
  sim::Params p = channel(17, 0.02, 900.0, 40.0, Wall::kNoSlip);
  p.walls.velocity[2] = {-0.2, 0, 0};
  p.walls.velocity[3] = {0.5, 0, 0};
  const auto s = make_simulation(p);
  run(*s, 6.0, 0.1);
  const std::vector<double> u = profile(*s);
  for (std::size_t j = 0; j < u.size(); ++j)
    CHECK(u[j] == Approx(-0.2 + 0.7 * static_cast<double>(j) / 17.0).margin(2e-3));
}

// Ghia, Ghia and Shin (1982), Re = 100: v_x on the vertical line through the middle.
TEST_CASE("The lid-driven cavity at Re = 100 is the one of the table", "[viscosity][law][nightly]") {
  const int cells = GENERATE(48, 64);
  const double h = 1.0 / cells;
  sim::Params p = box_params({1, 1, h}, h);
  p.gravity = Vec3d::Zero();
  p.fluid.density = 2.0;
  p.fluid.viscosity = 0.02 * 0.75;  // Re = 0.75 * 1 * 2 / 0.015 = 100
  p.walls.face = {Wall::kNoSlip, Wall::kNoSlip, Wall::kNoSlip, Wall::kNoSlip, Wall::kSlip, Wall::kSlip};
  p.walls.velocity[3] = {0.75, 0, 0};
  p.cfl_fluid = 1.0;
  const auto s = make_simulation(p);
  run(*s, 24.0, 1.0 / 6);
  constexpr std::array<std::array<double, 2>, 11> kTable = {{{.9766, .84123},
                                                             {.9531, .68717},
                                                             {.8516, .23151},
                                                             {.7344, .00332},
                                                             {.6172, -.13641},
                                                             {.5, -.20581},
                                                             {.4531, -.21090},
                                                             {.2813, -.15662},
                                                             {.1719, -.10150},
                                                             {.1016, -.06434},
                                                             {.0547, -.03717}}};
  const std::vector<double> u = profile(*s);
  double worst = 0.0;
  for (const auto& [y, exact] : kTable) {
    const auto j = static_cast<std::size_t>(y * cells);
    const double t = y * cells - static_cast<double>(j), at = ((1 - t) * u[j] + t * u[j + 1]) / 0.75;
    UNSCOPED_INFO("y " << y << ": " << at << ", table " << exact);
    worst = std::max(worst, std::abs(at - exact));
  }
  CHECK(worst < 0.02);
}

// Zhao, Freund and Moser (2008), Sugiyama et al. (2011): an incompressible neo-Hookean disc, G = 0.1, of the fluid's
// density in a cavity at Re = 100. The centre of the disc by a reference map method on 128 x 128 cells, which agrees
// with Sugiyama's path to 0.003 (with viscosity in the disc, which is not here).
TEST_CASE("A soft disc in a lid-driven cavity follows the path of the literature", "[viscosity][slab][law]") {
  constexpr int kCells = 48;
  const double h = 1.0 / kCells;
  sim::Params p = box_params({1, 1, h}, h);
  p.gravity = Vec3d::Zero();
  p.fluid.viscosity = 0.01;
  p.walls.face = {Wall::kNoSlip, Wall::kNoSlip, Wall::kNoSlip, Wall::kNoSlip, Wall::kSlip, Wall::kSlip};
  p.walls.velocity[3] = {1, 0, 0};
  p.cfl_fluid = 2.0;
  sim::SolidDesc d = ball_desc({0.6, 0.5, 0.5 * h});
  d.surface = cylinder_mesh(2, {0.6, 0.5, 0.5 * h}, 0.2, 2 * h);
  d.density = 1.0;
  d.youngs_modulus = 0.26;  // G = 0.1
  d.poissons_ratio = 0.3;
  d.law = material::Law::kStableNeoHookean;
  const auto s = make_simulation(p, {d});
  constexpr std::array<std::array<double, 2>, 7> kPath = {{{0.57623, 0.49480},
                                                           {0.53028, 0.49217},
                                                           {0.47259, 0.50159},
                                                           {0.41174, 0.52900},
                                                           {0.35527, 0.57753},
                                                           {0.31071, 0.64618},
                                                           {0.28786, 0.72689}}};
  for (const auto& [x, y] : kPath) {
    for (int frame = 0; frame < 12; ++frame) s->advance(1.0 / 24, {});
    const Vec3d center = s->diagnose_solid(0).center;
    INFO("at " << s->state().time << " s: " << center[0] << ", " << center[1] << "; reference " << x << ", " << y);
    CHECK(std::hypot(center[0] - x, center[1] - y) < 0.01);
  }
}

TEST_CASE("What comes in through a wall goes out through an open face", "[viscosity][law]") {
  const double viscosity = GENERATE(0.0, 0.05);
  sim::Params p = box_params({0.6, 0.26, 0.18}, 0.02);
  p.gravity = Vec3d::Zero();
  p.fluid.viscosity = viscosity;
  p.walls.face[1] = Wall::kOpen;
  p.walls.velocity[0] = {0.7, 0, 0};
  p.walls.velocity[3] = {0, 0.1, 0};  // and a part through the top
  const auto s = make_simulation(p);
  for (int i = 0; i < 20; ++i) s->advance(1.0 / 24, {});
  const grid::Grid& g = s->grid();
  const grid::VectorField& projected = s->workspace().velocity.field;  // before the transport
  const auto flux = [&](int i) {                                       // through a plane of nodes [m^3/s]
    double sum = 0.0;
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j) {
        const double edge_y = j == 0 || j == g.cells[1] ? 0.5 : 1.0, edge_z = k == 0 || k == g.cells[2] ? 0.5 : 1.0;
        sum += edge_y * edge_z * g.h * g.h * static_cast<double>(projected.c[0][g.node(i, j, k)]);
      }
    return sum;
  };
  const double in = 0.7 * 0.26 * 0.18, top = 0.1 * 0.18;  // the second per length
  CHECK(flux(0) == Approx(in).epsilon(0.01));
  for (const int i : {8, 15, 24}) CHECK(flux(i) == Approx(in - top * 0.02 * i).epsilon(0.01));
}

// What a collider closes is no part of what no pressure can take; counted in, no solve converged and the pressure was
// noise: it gave the collider 25 times the impulse across the lid.
TEST_CASE("A lid drives a fluid with a collider in it", "[viscosity]") {
  const double viscosity = GENERATE(0.0, 20.0);
  sim::Params p = box_params({0.6, 0.7, 0.5}, 0.05);
  p.gravity = Vec3d::Zero();
  p.fluid.density = 1000.0;
  p.fluid.viscosity = viscosity;
  p.walls.face.fill(Wall::kNoSlip);
  p.walls.velocity[3] = {0.5, 0.0, 0.0};
  const auto s = make_simulation(p);
  sim::SolidDesc body = ball_desc({0.3, 0.35, 0.25});
  body.surface = cylinder_mesh(1, {0.3, 0.35, 0.25}, 0.1, 0.2);
  geometry::MeshReport report;
  const std::size_t pin = s->add_collider(body, report);
  Vec3d impulse = Vec3d::Zero();
  for (int frame = 0; frame < 4; ++frame) {
    const sim::StepInfo info = s->advance(1.0 / 24, {});
    CHECK(info.unconverged == 0);
    CHECK(info.pressure_iterations < 20 * info.steps);
    impulse += info.pins[pin].impulse;
  }
  CHECK(std::abs(impulse[2]) < 0.02 * impulse.norm());  // the scene is its own mirror image
}

// The volume source of two that touch asks for what no pressure can take; the solve went on to a divergence of 15 / s.
TEST_CASE("Balls that touch in a viscous fluid between no-slip walls leave no noise in the pressure", "[viscosity]") {
  sim::Params p = box_params({0.6, 0.7, 0.5}, 0.05);
  p.fluid.density = 1000.0;
  p.fluid.viscosity = 20.0;
  p.walls.face.fill(Wall::kNoSlip);
  sim::SolidDesc a = ball_desc({0.33, 0.55, 0.26}), b = ball_desc({0.24, 0.38, 0.25});
  a.surface = ball_mesh({0.33, 0.55, 0.26}, 0.1);
  b.surface = ball_mesh({0.24, 0.38, 0.25}, 0.1);
  a.density = b.density = 1200.0;
  b.velocity = {0.2, 0.5, 0.1};
  const auto s = make_simulation(p, {a, b});
  for (int frame = 0; frame < 2; ++frame) {
    const sim::StepInfo info = s->advance(1.0 / 24, {});
    CHECK(info.unconverged == 0);
    CHECK(info.divergence_after < 2.0);
  }
}

TEST_CASE("A viscous fluid drags a solid along and loses what it gains", "[viscosity][law]") {
  sim::Params p = channel(24, 0.02, 800.0, 8.0, Wall::kPeriodic);
  p.domain_size[0] = 0.48;
  sim::SolidDesc d = ball_desc({0.11, 0.24, 0.01});
  d.surface = block({0.11, 0.24, 0.01}, {0.07, 0.05, 0.02});
  const auto s = make_simulation(p, {d});
  const grid::Grid& g = s->grid();
  std::vector<float> v(3 * g.node_count(), 0.0f);
  for (std::size_t n = 0; n < g.node_count(); ++n) v[n] = 0.2f;
  s->set_velocity(v.data());
  const auto momentum = [&] { return s->diagnose_fluid().momentum[0] + s->diagnose_solid(0).momentum[0]; };
  const double first = momentum();
  const double rest = s->diagnose_solid(0).momentum[0];
  CHECK(rest == 0.0);
  run(*s, 1.0, 1.0 / 48);
  const sim::SolidDiagnostics solid = s->diagnose_solid(0);
  const double common = first / (solid.mass + 800.0 * (0.48 * 0.48 * 0.02 - solid.volume_cells));
  INFO("solid " << solid.momentum[0] / solid.mass << ", common " << common);
  CHECK(momentum() == Approx(first).epsilon(0.02));
  CHECK(solid.momentum[0] / solid.mass == Approx(common).epsilon(0.05));
}

namespace {

constexpr double kPlateCell = 1.0 / 80, kPlateStep = 0.008, kPlateSpeed = 0.05;  // m, s, m/s

// A fluid at rest, of density 1 and viscosity 0.7, in which a step is 36 times as long as a node's own time h^2 / nu.
sim::Params plate_params() {
  sim::Params p = box_params({0.8, 1.0, kPlateCell}, kPlateCell);
  p.gravity = Vec3d::Zero();
  p.fluid.density = 1.0;
  p.fluid.viscosity = 0.7;
  p.max_time_step = kPlateStep;
  p.walls.face = {Wall::kOpen, Wall::kOpen, Wall::kSlip, Wall::kSlip, Wall::kSlip, Wall::kSlip};
  return p;
}

// Four cells thick, across the box and beyond it.
sim::SolidDesc plate_desc(double beyond) {
  const Vec3d center(0.4, 0.5, 0.5 * kPlateCell);
  sim::SolidDesc d = ball_desc(center);
  d.surface = block(center, {0.4 + beyond, 2 * kPlateCell, 0.5 * kPlateCell});
  return d;
}

}  // namespace

// Stokes (1851), a plate of mass m per area thrown along itself, fluid on both sides: what is left of its speed is
// exp(x^2) erfc(x), x = 2 sqrt(rho mu t) / m.
TEST_CASE("A viscous fluid brakes a thin plate as a whole, in steps that are long for its nodes", "[viscosity][law]") {
  const sim::Params p = plate_params();
  sim::SolidDesc d = plate_desc(0.0);
  d.density = GENERATE(1.0, 20.0);
  d.velocity = {kPlateSpeed, 0, 0};
  const auto s = make_simulation(p, {d});
  const double first = s->diagnose_solid(0).momentum[0];
  for (int i = 1; i <= 4; ++i) {
    REQUIRE(s->step(kPlateStep).dt == Approx(kPlateStep));
    const double x = 2 * std::sqrt(p.fluid.viscosity * i * kPlateStep) / (4 * kPlateCell * d.density);
    const double lost = 1 - s->diagnose_solid(0).momentum[0] / first, exact = 1 - std::exp(x * x) * std::erfc(x);
    INFO("step " << i << ", density " << d.density << ": " << lost / exact << " of the drag");
    CHECK(lost == Approx(exact).epsilon(0.06));
  }
}

// The same, at constant speed: 2 sqrt(rho mu t / pi) of momentum per area and side.
TEST_CASE("A collider reports the drag of a viscous fluid", "[viscosity][law]") {
  const sim::Params p = plate_params();
  const auto s = make_simulation(p);
  geometry::MeshReport report;
  const std::size_t pin = s->add_collider(plate_desc(0.1), report);
  s->set_motion(pin, 0.0, 1.0, sim::Pose(), sim::Pose{Mat3d::Identity(), {kPlateSpeed, 0, 0}});
  double impulse = 0.0;
  for (int i = 1; i <= 4; ++i) {
    const sim::StepInfo info = s->step(kPlateStep);
    REQUIRE(info.dt == Approx(kPlateStep));
    impulse += info.pins[pin].impulse[0];
    const double exact =
        4 * 0.8 * kPlateCell * kPlateSpeed * std::sqrt(p.fluid.viscosity * i * kPlateStep / 3.14159265358979);
    INFO("step " << i << ": " << impulse / exact << " of the drag");
    CHECK(impulse == Approx(exact).epsilon(0.06));
  }
}

TEST_CASE("A fluid without viscosity has no tile and no byte of it", "[viscosity]") {
  sim::Params p = box_params({0.4, 0.4, 0.4});
  const auto plain = make_simulation(p);
  plain->advance(1.0 / 24, {});
  CHECK(plain->workspace().viscous.bytes() == 0);
  const auto tiles = plain->profile().tiles[static_cast<std::size_t>(sim::Stage::kFluidForces)];
  p.fluid.viscosity = 0.1;
  const auto viscous = make_simulation(p);
  viscous->advance(1.0 / 24, {});
  CHECK(viscous->workspace().viscous.bytes() > 0);
  CHECK(viscous->profile().tiles[static_cast<std::size_t>(sim::Stage::kFluidForces)] > tiles);
}

TEST_CASE("Walls whose motion can have no effect, and inflow that cannot leave, are refused", "[viscosity]") {
  const auto message = [](const auto& change) {
    sim::Params p = box_params({0.4, 0.3, 0.2});
    change(p);
    try {
      sim::validate(p);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  CHECK_THAT(message([](sim::Params& p) { p.fluid.viscosity = -1; }),
             Catch::Contains("fluid_viscosity = -1: must be a finite number >= 0"));
  CHECK_THAT(message([](sim::Params& p) {
               p.walls.velocity[3] = {1, 0, 0};
             }),
             Catch::Contains("wall_velocity[3].x = 1: must be 0 along a slip wall"));
  CHECK_THAT(message([](sim::Params& p) {
               p.walls.velocity[0] = {2, 0, 0};
             }),
             Catch::Contains("net inflow [m^3/s] = 0.12: must be 0 in a box without an open face"));
  CHECK(message([](sim::Params& p) { p.walls.velocity[0] = p.walls.velocity[1] = {2, 0, 0}; }) == "none");
  CHECK_THAT(message([](sim::Params& p) {
               p.walls.face[1] = Wall::kOpen;
               p.walls.velocity[1] = {2, 0, 0};
             }),
             Catch::Contains("wall_velocity[1].x = 2: must be 0 on an open or periodic face"));
  CHECK_THAT(message([](sim::Params& p) {
               p.fluid.present = false;
               p.walls.velocity[1] = {2, 0, 0};
             }),
             Catch::Contains("must be 0 without ambient fluid"));
  CHECK_THAT(message([](sim::Params& p) {
               p.domain_size[2] = p.voxel_size;
               p.walls.velocity[5] = p.walls.velocity[4] = {0, 0, 1};
             }),
             Catch::Contains("wall_velocity[4].z = 1: must be 0 across a slab"));
}
