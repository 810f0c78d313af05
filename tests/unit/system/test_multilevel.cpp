// Purpose: multilevel diagonal scaling of the velocity system against full matrices, and what it is for: iterations
// that grow neither with the number of cells nor with the time step.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "grid/boundary.hpp"
#include "reference/assembled_multilevel.hpp"
#include "system/multilevel.hpp"
#include "unit/solid/ball.hpp"
#include "unit/system/dense.hpp"

using namespace efsi;
using namespace efsi::test;
using system::SolidRef;
using system::VelocitySolver;
using system::VelocitySystem;

namespace {

constexpr double kPrecise = sizeof(Real) == 8 ? 1e-11 : 2e-5;
constexpr system::StiffnessShares kBackwardEuler;

TestSolid make_box(const grid::Grid& g, const material::Elastic& elastic, const Vec3d& low, const Vec3d& high) {
  const Vec3d margin = Vec3d::Constant(3.0 * g.h), middle = 0.5 * (low + high), half = 0.5 * (high - low);
  return make_solid(g, elastic, sample_distance(low - margin, high + margin, 0.5 * g.h, [&](const Vec3d& x) {
                      const Vec3d q = (x - middle).cwiseAbs() - half;
                      return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
                    }));
}

// A bar of rubber, 1 m x 0.5 m x 0.5 m, held at one end; gravity bends it.
struct HeldBar {
  grid::Grid g;
  TestSolid solid;
  VelocitySystem system;

  HeldBar(int cells, double dt) {
    g.h = 1.0 / cells;
    g.cells = {cells + 4, cells / 2 + 4, cells / 2 + 4};
    const Vec3d low = Vec3d::Constant(2.0 * g.h);
    solid = make_box(g, material::from_youngs_modulus(material::Law::kCorotational, 1e5, 0.4), low,
                     low + Vec3d(1.0, 0.5, 0.5));
    compute(solid, 1);
    const std::vector<SolidRef> refs{
        {&solid.rest, &solid.state, &solid.work, kBackwardEuler, kBackwardEuler, kBackwardEuler}};
    system.assemble(Parallel(1), g, std::vector<std::uint8_t>(g.node_count(), 0), refs, solid.work.mass, {}, dt);
    for (std::size_t u = 0; u < system.nodes().size(); ++u)
      for (int a = 0; a < 3; ++a)
        if (system.place(u)[0] < low[0] + 0.5 * g.h) system.fix(u, a);
  }
  int iterations() {
    std::vector<Real> weight(3 * system.nodes().size(), 0), x(weight.size(), 0);
    for (std::size_t u = 0; u < system.nodes().size(); ++u) weight[3 * u + 1] = -solid.work.mass[system.nodes()[u]];
    const auto stats = system.solve(Parallel(1), VelocitySolver::kPcg, weight, x, 0.01);
    REQUIRE(stats.converged);
    return stats.iterations;
  }
};

// Two balls that share nodes, of different stiffness; the first lies on the floor, a pin holds one node of the other,
// which pushes on the first.
struct TwoBalls {
  grid::Grid g;
  grid::Walls walls;
  std::vector<Real> mass;
  TestSolid solids[2];
  VelocitySystem system;

  // cells along each axis; those of the twin are halves of each other on all levels.
  explicit TwoBalls(double dt, int threads = 1, int cells = 15) : g(cube_grid(cells, 0.05)) {
    const Parallel parallel(threads);
    solids[0] =
        make_ball(g, material::from_youngs_modulus(material::Law::kCorotational, 2e5, 0.3), {0.3, 0.13, 0.3}, 0.16);
    solids[1] = make_ball(g, material::from_youngs_modulus(material::Law::kStableNeoHookean, 1e6, 0.4),
                          {0.38, 0.4, 0.35}, 0.16);
    mass.assign(g.node_count(), static_cast<Real>(g.h * g.h * g.h));
    std::vector<SolidRef> refs;
    for (TestSolid& s : solids) {
      set_displacement(
          s, [](const Vec3d& x) { return Vec3d(0.01 * std::sin(9 * x[1]), 0.05 * x[2] * x[0], -0.03 * x[1]); });
      compute(s, 1, threads);
      for (std::size_t n = 0; n < mass.size(); ++n) mass[n] += s.work.mass[n];
      refs.push_back({&s.rest, &s.state, &s.work, kBackwardEuler, kBackwardEuler, kBackwardEuler});
    }
    system.assemble(parallel, g, grid::fixed_by_walls(g, walls), refs, mass, {}, dt);
    const std::size_t first = system.begin_of(1), pinned = first + 30;
    for (int a = 0; a < 3; ++a) system.fix(pinned, a);
    system.tie(first + 5, first + 6, 1);
    system.set_penalties(parallel, {{{{first - 1, Real(0.7)}, {first - 2, Real(0.3)}, {first + 2, Real(-1)}},
                                     20 * Vec3(1, 2, 2).asDiagonal().toDenseMatrix()}});
  }
  // Random where something moves by itself.
  std::vector<Real> random_vector(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Real> x(system.free().size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = system.free()[i] * static_cast<Real>(normal(random));
    return x;
  }
};

}  // namespace

TEST_CASE("Velocity iterations hardly grow with the number of cells and with the time step", "[law]") {
  for (const int cells : {12, 24, 48})
    for (const double dt : {0.02, 0.06, 0.2}) {
      const int iterations = HeldBar(cells, dt).iterations();
      CHECK(iterations <= 55);  // by the diagonal alone 16 to 250
    }
}

TEST_CASE("Multilevel scaling is the sum over the levels of full matrices") {
  TwoBalls scene(0.02, 1, 16);
  system::MultilevelScaling scaling(Parallel(1), scene.system, {1, 1});
  REQUIRE(scaling.levels() >= 2);
  for (const bool pushed : {true, false}) {
    if (!pushed) scene.system.set_penalties(Parallel(1), {});
    scaling.set_penalties(Parallel(1), scene.system.penalties());
    const std::vector<Real> r = scene.random_vector(61);
    std::vector<Real> z(r.size(), 0);
    scaling.add(Parallel(1), scene.system.free(), r, z);
    const Eigen::VectorXd expected = reference::multilevel_scaling(scene.system, scaling.levels()) * to_vector(r);
    CHECK((to_vector(z) - expected).norm() < 10 * kPrecise * expected.norm());
  }
}

TEST_CASE("The preconditioner of stiff solids is symmetric and positive definite") {
  TwoBalls scene(0.02);
  const std::vector<Real> x = scene.random_vector(62), y = scene.random_vector(63);
  std::vector<Real> px, py;
  scene.system.precondition(Parallel(1), x, px);
  scene.system.precondition(Parallel(1), y, py);
  CHECK(to_vector(y).dot(to_vector(px)) ==
        Approx(to_vector(x).dot(to_vector(py))).margin(kPrecise * to_vector(px).norm() * to_vector(y).norm()));
  CHECK(to_vector(x).dot(to_vector(px)) > 0.0);
  CHECK(to_vector(y).dot(to_vector(py)) > 0.0);
}

TEST_CASE("Stiff solids are scaled on many levels, others by the diagonal alone") {
  for (const bool stiff : {false, true}) {
    TwoBalls scene(stiff ? 0.02 : 0.001);
    scene.system.set_penalties(Parallel(1), {});
    std::vector<Real> r(scene.system.free().size(), 0), z;
    const std::size_t in_first = 3 * (scene.system.begin_of(1) / 2);
    REQUIRE(scene.system.free()[in_first] > 0);
    r[in_first] = 1;
    scene.system.precondition(Parallel(1), r, z);
    std::size_t answers = 0, of_other = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      answers += z[i] != 0;
      of_other += z[i] != 0 && i >= 3 * scene.system.begin_of(1);
    }
    CHECK((answers > 1) == stiff);
    CHECK(of_other == 0);  // solids do not couple but by what they share
  }
}

TEST_CASE("Conjugate gradients with multilevel scaling find the solution of a direct solve") {
  TwoBalls scene(0.02);
  const auto size = static_cast<Eigen::Index>(scene.system.free().size());
  Eigen::MatrixXd g(size, size);
  std::vector<Real> column;
  for (Eigen::Index i = 0; i < size; ++i) {
    std::vector<Real> unit(static_cast<std::size_t>(size), 0);
    unit[static_cast<std::size_t>(i)] = 1;
    scene.system.apply(Parallel(1), unit, column);
    g.col(i) = to_vector(column);
  }
  const double tolerance = sizeof(Real) == 8 ? 1e-9 : 1e-5;
  const std::vector<Real> b = scene.random_vector(64);
  const Eigen::VectorXd free = to_vector(scene.system.free());
  Eigen::MatrixXd reduced = free.asDiagonal() * g * free.asDiagonal();
  reduced.diagonal() += Eigen::VectorXd::Ones(size) - free;
  const Eigen::VectorXd exact = reduced.ldlt().solve(to_vector(b));
  for (const auto solver : {VelocitySolver::kPcg, VelocitySolver::kPcr}) {
    std::vector<Real> x(b.size(), 0);
    CHECK(scene.system.solve(Parallel(1), solver, b, x, tolerance).converged);
    CHECK((free.cwiseProduct(to_vector(x)) - exact).norm() < 300.0 * tolerance * exact.norm());
  }
}

TEST_CASE("Multilevel scaling gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  std::vector<Real> first;
  for (int threads : {1, 2, 3, 8}) {
    TwoBalls scene(0.02, threads);
    std::vector<Real> b = scene.random_vector(65), x(b.size(), 0);
    scene.system.solve(Parallel(threads), VelocitySolver::kPcg, b, x, 1e-3);
    if (first.empty()) first = x;
    CHECK(x == first);
  }
}
