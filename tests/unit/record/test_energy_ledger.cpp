// Purpose: the columns of the energy ledger against closed forms, the diagnostics and each other.
#include <numeric>

#include "record/energy_ledger.hpp"
#include "record/step_record.hpp"
#include "unit/sim/free_solid.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;
using sim::EnergyStage;

namespace {

sim::Params recorded(const Vec3d& size) {
  sim::Params p = vacuum(size);
  p.energy_ledger = true;
  return p;
}

const sim::EnergyRecord& energy(const sim::Simulation& s) { return *s.last_step().energy; }

const sim::Energy& change(const sim::Simulation& s, EnergyStage stage) {
  return energy(s).change[static_cast<std::size_t>(stage)];
}

// What the last step began with.
sim::Energy start_of(const sim::EnergyRecord& record) {
  sim::Energy all;
  for (const sim::Energy& column : record.change) all += column;
  return record.at_end - all;
}

}  // namespace

TEST_CASE("Ledger: a ball that flies and turns in vacuum has M v^2 / 2 + I w^2 / 2", "[law]") {
  sim::Params p = recorded({0.6, 0.6, 0.6});
  p.gravity = Vec3d::Zero();
  auto d = ball_desc({0.3, 0.3, 0.3});
  d.velocity = {0.5, 0.2, -0.1};
  d.angular_velocity = {0.0, 6.0, 0.0};
  auto s = make_simulation(p, {d});
  s->step(0.005);
  const double mass = 1000.0 * 4.0 / 3.0 * M_PI * 1e-3, inertia = 0.4 * mass * 0.01;
  const double exact = 0.5 * mass * d.velocity.squaredNorm() + 0.5 * inertia * 36.0;
  CHECK(start_of(energy(*s)).solid_kinetic == Approx(exact).epsilon(0.02));
  CHECK(energy(*s).at_end.sum() == Approx(exact).epsilon(0.02));
  CHECK(energy(*s).at_end.fluid_kinetic == 0.0);
  CHECK(energy(*s).at_end.potential == 0.0);
}

TEST_CASE("Ledger: a collider's own energy does not count, that of the fluid which it pushes does", "[law]") {
  for (const bool fluid : {false, true}) {
    sim::Params p = recorded({0.8, 0.6, 0.6});
    p.fluid.present = fluid;
    p.gravity = fluid ? Vec3d::Zero() : Vec3d(0, -9.8, 0);
    const auto s = make_simulation(p, {ball_desc({0.2, 0.4, 0.3}, 0.08)});
    geometry::MeshReport report;
    const std::size_t pin = s->add_collider(ball_desc({0.6, 0.3, 0.3}, 0.08), report);
    const auto at = [](double x) { return sim::Pose{Mat3d::Identity(), {-x, 0, 0}}; };
    s->set_motion(pin, 0.0, 0.04, at(0.0), at(0.04));
    const auto alone = make_simulation(p, {ball_desc({0.2, 0.4, 0.3}, 0.08)});
    double work = 0.0;
    for (int n = 0; n < 4; ++n) {
      s->step(0.01);
      work += s->last_step().pins[pin].work;
      if (fluid) continue;
      alone->step(0.01);
      CHECK(energy(*s).at_end.sum() == Approx(energy(*alone).at_end.sum()).epsilon(1e-6));
    }
    INFO("work " << work << " J, energy " << energy(*s).at_end.sum() << " J");
    if (fluid) CHECK(energy(*s).at_end.sum() == Approx(0.5 * work).epsilon(0.3));  // set off at once: half is lost
    CHECK((fluid ? work > 0.0 : std::abs(work) < 1e-9));
  }
}

TEST_CASE("Ledger: what a falling body loses in potential energy it gains in kinetic energy", "[law]") {
  auto s = make_simulation(recorded({0.4, 0.8, 0.4}), {ball_desc({0.2, 0.6, 0.2})});
  s->step(0.01);
  const double first = start_of(energy(*s)).sum();
  double last = energy(*s).at_end.sum(), gravity = 0.0, kinetic = 0.0;
  for (int n = 0; n < 12; ++n) {
    s->step(0.01);
    CHECK(start_of(energy(*s)).sum() == Approx(last).epsilon(1e-6));  // nothing happens between two steps
    last = energy(*s).at_end.sum();
    gravity += change(*s, EnergyStage::kWeight).sum();
    kinetic = energy(*s).at_end.solid_kinetic;
    for (const auto stage : {EnergyStage::kSolidTransport, EnergyStage::kRemap}) gravity += change(*s, stage).potential;
  }
  CHECK(kinetic > 3.0);  // J: it does fall
  CHECK(std::abs(last - first) < 2e-3 * kinetic);
  CHECK(std::abs(gravity) < 2e-3 * kinetic);
}

TEST_CASE("Ledger: a body in fluid whose volume changes falls by the same energy, wherever the origin lies", "[law]") {
  const auto fall = [](double up) {  // of the potential energy [J]; up: the box's lower corner [m]
    sim::Params p = recorded({0.4, 0.8, 0.4});
    p.fluid.present = true;
    p.fluid.density = 500.0;
    p.domain_min = {0.0, up, 0.0};
    const Vec3d center(0.2, up + 0.6, 0.2);
    auto d = ball_desc(center);
    d.compressible = true;
    auto s = make_simulation(p, {d});
    const double volume = s->diagnose_solid(0).volume_cells, height = s->diagnose_solid(0).center[1];
    stretch(*s, center, Vec3d::Constant(1.04));
    s->step(0.005);
    const double first = start_of(energy(*s)).potential;
    for (int n = 0; n < 11; ++n) s->step(0.005);
    const auto now = s->diagnose_solid(0);
    CHECK(std::abs(now.volume_cells / volume - 1.0) > 0.01);
    const double lost = first - energy(*s).at_end.potential;
    CHECK(lost == Approx(0.5 * now.mass * kGravity * (height - now.center[1])).epsilon(0.01));
    return lost;
  };
  CHECK(fall(10.0) == Approx(fall(0.0)).epsilon(1e-4));
}

TEST_CASE("Ledger: u and v of one time make an oscillation's energy steady", "[law]") {
  // A ball in vacuum, squeezed along x by its velocity: 40 steps a period of its quadrupole mode.
  sim::Params p = recorded({0.4, 0.4, 0.4});
  p.gravity = Vec3d::Zero();
  auto s = make_simulation(p, {ball_desc({0.2, 0.2, 0.2})});
  const grid::Grid& g = s->state().solids[0].band.grid;
  std::vector<float> v(3 * g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d x = g.node_position(i, j, k) - Vec3d::Constant(0.2);
        const Vec3d at = 4.0 * Vec3d(x[0], -0.5 * x[1], -0.5 * x[2]);
        for (std::size_t a = 0; a < 3; ++a)
          v[a * g.node_count() + g.node(i, j, k)] = static_cast<float>(at[static_cast<Eigen::Index>(a)]);
      }
  s->set_solid_field(0, true, v.data());
  double low = 1e9, high = 0.0, low_end = 1e9, high_end = 0.0, elastic = 0.0;
  for (int n = 0; n < 24; ++n) {
    s->step(0.00186);
    low = std::min(low, energy(*s).at_start.sum());
    high = std::max(high, energy(*s).at_start.sum());
    low_end = std::min(low_end, energy(*s).at_end.sum());
    high_end = std::max(high_end, energy(*s).at_end.sum());
    elastic = std::max(elastic, energy(*s).at_start.elastic);
  }
  CHECK(elastic > 0.5 * high);  // it does swing
  CHECK(high - low < 0.02 * high);
  CHECK(high_end - low_end > 5.0 * (high - low));
}

TEST_CASE("Ledger: the velocity of a rigid motion is that of the ends of a step", "[law]") {
  auto s = make_simulation(recorded({0.4, 0.8, 0.4}), {ball_desc({0.2, 0.6, 0.2})});
  double first = 0.0;
  for (int n = 0; n < 6; ++n) {
    s->step(0.02);
    const sim::Energy began = start_of(energy(*s)), met = energy(*s).at_start;
    CHECK(std::abs(met.solid_kinetic - began.solid_kinetic) < 1e-3 * (0.01 + began.solid_kinetic));
    if (n == 0) first = met.sum();
    // The centre of the nodes' masses wavers by less than a hundredth of a cell.
    CHECK(std::abs(met.sum() - first) < 0.01 * 0.02 * 9.8 * 4.19);
  }
}

TEST_CASE("Ledger: on or off, a run has the same bits") {
  for (const auto preset : {sim::Preset::kProduction, sim::Preset::kPaper2016})
    for (const bool fluid : {true, false}) {
      std::uint64_t hash[2];
      for (const bool on : {false, true}) {
        sim::Params p = box_params({0.3, 0.36, 0.3});
        p.numerics = sim::numerics_of(preset);
        p.fluid.present = fluid;
        p.energy_ledger = on;
        auto d = ball_desc({0.15, 0.13, 0.15});
        d.velocity = {0.2, -2.0, 0.0};
        auto s = make_simulation(p, {d});
        for (int n = 0; n < 4; ++n) s->step(0.01);
        CHECK(s->last_step().energy.has_value() == on);
        hash[on] = sim::state_hash(s->state());
      }
      CHECK(hash[0] == hash[1]);
    }
}

TEST_CASE("Ledger: its columns join the energies that the diagnostics tell", "[law]") {
  for (const auto preset : {sim::Preset::kProduction, sim::Preset::kPaper2016}) {
    sim::Params p = box_params({0.8, 0.8, 0.8});
    p.numerics = sim::numerics_of(preset);
    p.energy_ledger = true;
    p.fluid.density = 500.0;
    auto d = ball_desc({0.4, 0.4, 0.4});
    d.velocity = {0.0, -1.0, 0.0};
    auto s = make_simulation(p, {d});
    sim::Energy sum;
    const auto solid_before = s->diagnose_solid(0);
    for (int n = 0; n < 5; ++n) {
      s->step(0.005);
      for (const sim::Energy& column : energy(*s).change) sum += column;
    }
    const auto solid = s->diagnose_solid(0);
    const double scale = solid_before.kinetic_energy;
    CHECK(std::abs(sum.solid_kinetic - (solid.kinetic_energy - solid_before.kinetic_energy)) < 1e-3 * scale);
    CHECK(std::abs(sum.elastic - (solid.elastic_energy - solid_before.elastic_energy)) < 1e-3 * scale);
    const sim::FluidDiagnostics fluid = s->diagnose_fluid();
    CHECK((fluid.carried_energy != 0.0) == (preset == sim::Preset::kProduction));
    CHECK(energy(*s).at_end.fluid_kinetic == Approx(fluid.kinetic_energy + fluid.carried_energy).epsilon(1e-3));
    const double weight = solid.mass - 500.0 * solid.mass / 1000.0;
    CHECK(sum.potential == Approx(weight * 9.8 * (solid.center[1] - solid_before.center[1])).epsilon(1e-3));
    CHECK(change(*s, EnergyStage::kMixing).sum() <= 1e-6 * scale);
    CHECK(change(*s, EnergyStage::kExternal).sum() == 0.0);
  }
}

TEST_CASE("Ledger: a pressure p does the work p b h^3 dt where the volume grows at a rate b") {
  const grid::Grid g = cube_grid(4, 0.1);
  std::vector<Real> pressure(g.padded_count(), Real(7)), source(g.padded_count(), Real(0));
  CHECK(sim::source_work(Parallel(2), g, pressure, {}, 0.5) == 0.0);
  source[g.padded(1, 2, 3)] = Real(3);
  source[g.padded(0, 0, 0)] = Real(-1);
  source[g.padded(-1, 0, 0)] = Real(100);  // a ghost
  CHECK(sim::source_work(Parallel(2), g, pressure, source, 0.5) == Approx(0.5 * 7.0 * 2.0 * 1e-3));
}

TEST_CASE("Ledger: nodes of a periodic face count once") {
  grid::Grid g = cube_grid(4, 0.1);
  std::vector<Real> mass(g.node_count(), Real(2));
  grid::VectorField velocity;
  velocity.assign(g.node_count(), Real(1));
  CHECK(sim::kinetic_energy(Parallel(2), g, mass, velocity) == Approx(125 * 3.0));
  g.periodic[1] = true;
  CHECK(sim::kinetic_energy(Parallel(2), g, mass, velocity) == Approx(100 * 3.0));
  CHECK(sim::kinetic_energy(Parallel(2), g, mass, velocity, Vec3(1, 0, 0)) == Approx(100 * 6.0));
}

TEST_CASE("Transport: what it changes is told before it is given back", "[law]") {
  sim::Params p = recorded({0.6, 0.6, 0.6});
  p.gravity = Vec3d::Zero();
  auto d = ball_desc({0.3, 0.3, 0.3});
  d.velocity = {1.0, 0.0, 0.0};
  d.angular_velocity = {0.0, 0.0, 10.0};
  auto s = make_simulation(p, {d});
  const auto before = s->diagnose_solid(0);
  double lost = 0.0;
  for (int n = 0; n < 5; ++n) {
    s->step(0.01);
    REQUIRE(s->last_step().transport.size() == 1);
    lost += s->last_step().transport[0].momentum.norm();
  }
  CHECK(lost > 1e-5 * before.momentum.norm());  // the transport loses some
  CHECK(lost < 0.05 * before.momentum.norm());
  CHECK((s->diagnose_solid(0).momentum - before.momentum).norm() < 1e-5 * before.momentum.norm());
}

TEST_CASE("Mass: what the cells count is told before it is scaled", "[law]") {
  sim::Params p = recorded({0.6, 0.6, 0.6});
  p.gravity = Vec3d::Zero();
  auto d = ball_desc({0.25, 0.3, 0.3});
  d.velocity = {1.0, 0.3, 0.0};
  d.angular_velocity = {0.0, 0.0, 10.0};
  auto s = make_simulation(p, {d});
  const double mass = s->diagnose_solid(0).mass;
  double most = 0.0;
  for (int n = 0; n < 10; ++n) {
    s->step(0.01);
    most = std::max(most, std::abs(s->last_step().transport[0].mass));
    CHECK(s->diagnose_solid(0).mass == Approx(mass).epsilon(1e-6));
  }
  INFO("counted mass is off by up to " << most);
  CHECK(most > 1e-5);  // it wavers as the ball moves over the grid
  CHECK(most < 0.01);
}

TEST_CASE("Transport: changes of momentum and volume of a solid that is pushed and swells") {
  const grid::Grid g = cube_grid(20, 0.05);
  TestSolid t = make_ball(g, {}, {0.5, 0.5, 0.5}, 0.3);
  t.rest.surface = ball_mesh({0.5, 0.5, 0.5}, 0.3);
  t.state.surface = t.rest.surface.points;
  compute(t, 1);
  t.state.rest_volume_cells = t.work.volume;
  compute(t, 1);
  const Parallel parallel(2);
  const auto momenta = [&] { return solid::measure_momenta(parallel, t.state.band, t.work, g, t.state.v); };
  const solid::Momenta before = momenta();
  t.work.next_volume = 1.01;
  const sim::VolumeTarget target = sim::volume_target(t.rest, t.state, t.work);
  CHECK(target.mesh == Approx(1.01));
  CHECK(target.cells == Approx(1.01));
  const Vec3d push(0.1, 0.2, -0.3);
  for (std::size_t n = 0; n < t.state.v.size(); ++n) t.state.v.set(n, push.cast<Real>());
  for (Vec3d& x : t.state.surface) x = Vec3d(0.5, 0.5, 0.5) + 1.01 * (x - Vec3d(0.5, 0.5, 0.5));
  const sim::TransportError change = sim::transport_error(parallel, t.rest, t.state, t.work, target, before);
  CHECK((change.momentum - t.work.total_mass * push).norm() < 1e-5 * t.work.total_mass);
  CHECK(change.angular_momentum.norm() < 1e-5 * t.work.total_mass);
  CHECK(change.volume_mesh == Approx(std::pow(1.01, 3) - 1.01).epsilon(1e-6));
  CHECK(change.volume_cells == Approx(-0.01).epsilon(1e-3));
  CHECK(change.mass == Approx(0.0).margin(1e-6));
  t.work.cell_mass = 1.02 * t.work.total_mass;  // by the cells before it was scaled
  CHECK(sim::transport_error(parallel, t.rest, t.state, t.work, target, before).mass == Approx(0.02));
}

TEST_CASE("Repairs: none while a ball flies; det F is told before and after") {
  auto s = make_simulation(recorded({0.4, 0.4, 0.4}), {ball_desc({0.2, 0.2, 0.2})});
  s->step(0.01);
  const sim::Repairs& r = s->last_step().repairs;
  CHECK(r.clamped + r.rejected + r.broken + r.repaired_cells == 0);
  CHECK(r.min_det_f_before == Approx(1.0).epsilon(1e-3));
  CHECK(r.max_det_f_before == Approx(1.0).epsilon(1e-3));
  CHECK(r.min_det_f_after == r.min_det_f_before);
  CHECK(r.max_det_f_after == r.max_det_f_before);
}
