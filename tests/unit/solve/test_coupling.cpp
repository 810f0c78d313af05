// Purpose: where the fluid slips along a solid; what pressure and elasticity agree on.
#include <Eigen/Dense>

#include "nodes/masses.hpp"
#include "nodes/node_velocity.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_force.hpp"
#include "solve/pressure.hpp"
#include "solve/velocity_solve.hpp"
#include "system/films.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const material::Elastic kRubber{material::Law::kCorotational, 1e4, 5e3};

// Solids in a box of cells of 0.02 m, ready for the stages of a step.
struct StagedScene {
  sim::Params params;
  grid::Grid g;
  std::vector<solid::SolidRest> rest;
  std::vector<fluid::Emitter> emitters;
  std::vector<sim::ForceField> forces;
  std::vector<sim::Pin> pins;
  sim::State state;
  sim::Workspace work;
  sim::Scene as_scene{params, g, rest, emitters, forces, pins};
  Parallel parallel{2};
  sim::Profile profile;
  sim::StepInfo info;

  StagedScene(const StagedScene&) = delete;  // the scene refers to it
  StagedScene& operator=(const StagedScene&) = delete;
  explicit StagedScene(const Vec3d& size) : params(box_params(size)), g(sim::make_grid(params)) {}
  void add(const TestSolid& s) {
    rest.push_back(s.rest);
    state.solids.push_back(s.state);
    work.solids.resize(rest.size());
  }
  sim::StepContext context(double dt) { return {parallel, as_scene, 0.0, dt, dt, profile, info}; }
  void make_masses() {
    const sim::StepContext step = context(0.0);
    sim::compute_masses(step, state.solids, work.solids);
    sim::combine_masses(step, state.solids, work.solids, state.window, state.fluid.pressure, work.matter,
                        work.velocity.slip);
  }
};

// A block of 9 x 6 x 6 cells with a slot of `slot` cells across x (none below 0), on the floor of a box or `floor`
// cells above it.
struct SlottedBlock : StagedScene {
  SlottedBlock(double slot, int floor) : StagedScene({0.4, 0.3, 0.3}) {
    const double h = g.h;
    const Vec3d middle(10 * h + h / 2, (floor + 3) * h, 7 * h), half(4.5 * h, 3 * h, 3 * h);
    const auto distance = [&](const Vec3d& x) {
      const Vec3d beyond = (x - middle).cwiseAbs() - half;
      return std::max(beyond.maxCoeff(), 0.5 * slot * h - std::abs(x[0] - middle[0]));
    };
    add(make_solid(g, kRubber,
                   sample_distance(middle - half - Vec3d::Constant(4 * h), middle + half + Vec3d::Constant(4 * h),
                                   h / 8, distance)));
    make_masses();
  }

  std::size_t slipping(int lowest_x, int highest_x) const {
    std::size_t count = 0;
    for (const system::SlipNode& n : work.velocity.slip.nodes()) count += n.i >= lowest_x && n.i <= highest_x;
    return count;
  }
};

// The middle of a step of a ball in vacuum that is squeezed evenly at first: velocity solve, pressure, projection.
struct SqueezedBall : StagedScene {
  SqueezedBall(double dt, bool coupling_step) : StagedScene({0.2, 0.2, 0.2}) {
    params.gravity.setZero();
    params.fluid.present = false;
    params.numerics.coupling_step = coupling_step;
    params.numerics.volume_source = false;
    params.numerics.velocity_tolerance = 1e-5;
    params.numerics.pressure_tolerance = 1e-4;
    const Vec3d center(0.101, 0.098, 0.1);
    TestSolid ball = make_ball(g, kRubber, center, 0.05);
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i)
          ball.state.v.set(g.node(i, j, k), Vec3((-(g.node_position(i, j, k) - center)).cast<Real>()));
    add(ball);
    sim::SolidWorks& solids = work.solids;
    sim::Matter& matter = work.matter;
    sim::NodeVelocity& velocity = work.velocity;
    sim::VelocityEquation& elasticity = work.elasticity;
    sim::PressureEquation& pressure = work.pressure;
    make_masses();
    const sim::StepContext step = context(dt);
    solid::compute_material(parallel, rest[0], state.solids[0], 1, solids[0]);
    sim::combine_velocities(step, state.solids, solids, matter, state.fluid.velocity, velocity);
    sim::assemble_velocity_system(step, state.solids, solids, matter, velocity, elasticity);
    sim::set_right_side(step, state.solids, solids, matter.common.grid, velocity, elasticity);
    sim::prepare_pressure(step, state.solids, solids, matter, state.fluid.pressure, elasticity, velocity, pressure);
    sim::solve_velocity(step, elasticity, velocity);
    before = unknowns(velocity.field);
    sim::solve_pressure(step, state.solids, solids, matter, state.fluid, elasticity, velocity, pressure);
    sim::project_velocity(step, matter.common.grid, elasticity, pressure, velocity, state.fluid.pressure);
    after = unknowns(velocity.field);
  }

  Eigen::VectorXd before, after;  // v* and v on the unknowns

  Eigen::VectorXd unknowns(const grid::VectorField& velocity) {
    std::vector<Real> x;
    work.elasticity.system.gather(Parallel(1), velocity, work.velocity.slip, x);
    return Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, 1>>(x.data(), static_cast<Eigen::Index>(x.size()))
        .cast<double>();
  }
  // Slow twin: G column by column, J by unit velocities, and the v without divergence that is nearest to v* by G.
  Eigen::MatrixXd stiff() {
    const auto n = static_cast<Eigen::Index>(3 * work.elasticity.system.unknowns());
    Eigen::MatrixXd out(n, n);
    std::vector<Real> x(static_cast<std::size_t>(n), 0), y;
    for (Eigen::Index c = 0; c < n; ++c) {
      x[static_cast<std::size_t>(c)] = 1;
      work.elasticity.system.apply(Parallel(1), x, y);
      x[static_cast<std::size_t>(c)] = 0;
      for (Eigen::Index r = 0; r < n; ++r) out(r, c) = static_cast<double>(y[static_cast<std::size_t>(r)]);
    }
    return out;
  }
  Eigen::VectorXd agreed(const Eigen::MatrixXd& stiffness) const {
    const auto& nodes = work.elasticity.system.nodes();
    std::vector<std::size_t> cells;
    for (std::size_t c = 0; c < work.matter.owned.size(); ++c)
      if (work.matter.owned[c]) cells.push_back(c);
    const auto n = stiffness.rows(), m = static_cast<Eigen::Index>(cells.size());
    Eigen::MatrixXd j(m, n);
    const grid::Grid& common = work.matter.common.grid;
    grid::VectorField v;
    v.assign(common.node_count());
    std::vector<Real> flux;
    const double h3 = g.h * g.h * g.h;
    for (Eigen::Index c = 0; c < n; ++c) {
      Real& value = v.c[static_cast<std::size_t>(c % 3)][nodes[static_cast<std::size_t>(c / 3)]];
      value = 1;
      system::compute_flux(Parallel(1), common, v, {}, flux);
      value = 0;
      for (Eigen::Index r = 0; r < m; ++r) j(r, c) = static_cast<double>(flux[cells[static_cast<std::size_t>(r)]]) / h3;
    }
    const Eigen::LDLT<Eigen::MatrixXd> inverse(stiffness);
    const Eigen::MatrixXd reached = j * inverse.solve(Eigen::MatrixXd(j.transpose()));
    return before - inverse.solve(j.transpose() * reached.ldlt().solve(j * before));
  }
};

}  // namespace

TEST_CASE("The coupling step leads to the velocity that pressure and elasticity agree on", "[law]") {
  for (const double dt : {0.002, 0.01, 0.04}) {
    SqueezedBall plain(dt, false), coupled(dt, true);
    const Eigen::MatrixXd g = coupled.stiff();
    const Eigen::VectorXd agreed = coupled.agreed(g);
    const auto length = [&](const Eigen::VectorXd& v) { return std::sqrt(v.dot(g * v)); };
    const double all = length(agreed - coupled.before);
    const double apart = length(plain.after - agreed) / all, left = length(coupled.after - agreed) / all;
    INFO("dt " << dt << ": " << apart << " without, " << left << " with it");
    REQUIRE(all > 0.0);
    CHECK((plain.before - coupled.before).norm() == 0.0);
    CHECK(left < 0.1);
    CHECK(left < 0.5 * apart);
    CHECK(coupled.info.divergence_after < 1e-3 * coupled.info.divergence_before);
  }
}

TEST_CASE("The velocity of a node holds the momentum of all that is there") {
  StagedScene pair({0.3, 0.2, 0.2});
  pair.params.gravity.setZero();
  pair.params.numerics.fluid_slips = pair.params.numerics.unilateral_walls = false;
  pair.add(make_ball(pair.g, kRubber, {0.1, 0.1, 0.1}, 0.05));
  pair.add(make_ball(pair.g, kRubber, {0.195, 0.1, 0.1}, 0.05));
  pair.rest[1].density = 300.0;
  const Vec3 own[2] = {Vec3(1, 0, 2), Vec3(-3, 1, 0)}, flow(0, 2, -1);
  for (std::size_t l = 0; l < 2; ++l)
    for (std::size_t n = 0; n < pair.state.solids[l].v.size(); ++n) pair.state.solids[l].v.set(n, own[l]);
  const std::size_t nodes = pair.g.node_count();
  pair.state.fluid.velocity.assign(nodes);
  for (std::size_t n = 0; n < nodes; ++n) pair.state.fluid.velocity.set(n, flow);
  pair.make_masses();
  const sim::Matter& matter = pair.work.matter;
  sim::combine_velocities(pair.context(0.01), pair.state.solids, pair.work.solids, matter, pair.state.fluid.velocity,
                          pair.work.velocity);
  std::size_t shared = 0;
  for (std::size_t n = 0; n < nodes; ++n) {
    const auto [i, j, k] = pair.g.node_place(n);
    Vec3 momentum = matter.fluid_mass[n] * flow;
    Real mass = matter.fluid_mass[n];
    int solids = 0;
    for (std::size_t l = 0; l < 2; ++l) {
      const grid::Grid& band = pair.state.solids[l].band.grid;
      const Vec3i at = {i - band.lo[0], j - band.lo[1], k - band.lo[2]};
      bool inside = true;
      for (std::size_t a = 0; a < 3; ++a) inside = inside && at[a] >= 0 && at[a] <= band.cells[a];
      const Real m = inside ? pair.work.solids[l].mass[band.node(at[0], at[1], at[2])] : Real(0);
      momentum += m * own[l];
      mass += m;
      solids += m > 0;
    }
    shared += solids == 2;
    REQUIRE(matter.mass[n] == Approx(mass));
    REQUIRE((matter.mass[n] * pair.work.velocity.field.at(n) - momentum).norm() <= 1e-5f * momentum.norm());
  }
  CHECK(shared > 4);
  CHECK(pair.state.fluid.velocity.size() == 0);  // taken out of the state
}

TEST_CASE("The fluid slips at the surface of a solid, with normals that point out of it") {
  const SlottedBlock block(-9.0, 4);
  CHECK(block.work.velocity.slip.nodes().size() == 10 * 7 * 7 - 8 * 5 * 5);
  for (const system::SlipNode& n : block.work.velocity.slip.nodes()) {
    const Vec3d outwards = Vec3d(n.i, n.j, n.k) - Vec3d(10.5, 7, 7);
    CHECK(n.normal.norm() == Approx(1.0));
    CHECK(n.normal.cast<double>().dot(outwards) > 0.0);
    CHECK(n.solid_mass > 0);
    CHECK(n.fluid_mass > 0);
  }
}

TEST_CASE("At corners of slivers alone the pressure moves the fluid, not the solid", "[law]") {
  StagedScene scene({0.4, 0.3, 0.3});
  const double h = scene.g.h;
  // A sheet of 1.3 cells: one layer of cells is its own, and the next one slivers.
  const Vec3d half(5 * h, 0.65 * h, 4 * h), middle(10 * h, 7.65 * h, 7 * h);
  TestSolid sheet =
      make_solid(scene.g, kRubber, sample_distance(middle - 2 * half, middle + 2 * half, 0.5 * h, [&](const Vec3d& x) {
                   return ((x - middle).cwiseAbs() - half).maxCoeff();
                 }));
  sheet.rest.element = solid::kElementPartInFluid;
  sheet.rest.stiff_by_part = sheet.rest.wet = true;
  sheet.rest.thin = solid::ThinParts(Parallel(1), sheet.rest.distance, h);
  scene.add(sheet);
  scene.make_masses();
  system::SlipNodes& slip = scene.work.velocity.slip;
  std::vector<Real> q(scene.g.padded_count());
  for (std::size_t c = 0; c < q.size(); ++c) q[c] = static_cast<Real>(std::sin(1.7 * static_cast<double>(c)));
  std::size_t apart = 0;
  for (std::size_t t = 0; t < slip.nodes().size(); ++t) {
    const system::SlipNode& n = slip.nodes()[t];
    CHECK((n.j == 9) == (n.solid_cells == 0));
    CHECK((n.normal == Vec3::Zero()) == (n.solid_cells == 0));
    CHECK((slip.solid_impulse(t, q) == Vec3::Zero()) == (n.solid_cells == 0));
    apart += n.solid_cells == 0;
  }
  CHECK(apart > 50);
  // Coarse levels of the pressure see the fluid there, and nothing new where a cell is the solid's.
  const std::vector<Real>& mixed = scene.work.matter.specific_volume;
  std::vector<Real> coarse = mixed;
  system::open_films(Parallel(2), scene.g, slip, coarse);
  for (const system::SlipNode& n : slip.nodes()) {
    CHECK(n.is_free() == (n.solid_cells == 0));
    CHECK(coarse[n.node] ==
          Approx(n.is_free() ? static_cast<Real>(h * h * h) / n.fluid_mass : mixed[n.node]).epsilon(1e-4));
    if (n.is_free()) CHECK(coarse[n.node] > 10 * mixed[n.node]);
  }
  // What the projection takes is the fluid's alone.
  scene.work.velocity.field.assign(scene.g.node_count());
  const std::vector<Vec3> before = slip.solid_velocity();
  slip.subtract_gradient(Parallel(2), q, scene.work.velocity.field);
  for (std::size_t t = 0; t < slip.nodes().size(); ++t)
    if (slip.nodes()[t].solid_cells == 0)
      CHECK((slip.solid_velocity()[t] - before[t]).norm() < 1e-6f * before[t].norm() + 1e-9f);
}

TEST_CASE("At walls, in gaps of less than a cell and with the paper's preset solid and fluid have one velocity") {
  const SlottedBlock on_the_floor(-9.0, 0);
  for (const system::SlipNode& n : on_the_floor.work.velocity.slip.nodes()) CHECK(n.j > 0);
  CHECK_FALSE(on_the_floor.work.velocity.slip.empty());

  const SlottedBlock gap(0.8, 4), slot(3.0, 4);
  REQUIRE(gap.work.matter.cell_fraction[gap.g.cell(10, 7, 7)] < solid::kElementPartInFluid.fraction);
  CHECK(gap.slipping(10, 11) == 0);
  CHECK(gap.slipping(6, 9) > 0);
  CHECK(slot.slipping(9, 12) > 0);
}
