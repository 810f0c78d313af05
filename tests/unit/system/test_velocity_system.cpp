// Purpose: the semi-implicit velocity system against a matrix assembled from the elements.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "grid/boundary.hpp"
#include "system/velocity_system.hpp"
#include "unit/solid/ball.hpp"
#include "unit/system/dense.hpp"

using namespace efsi;
using namespace efsi::test;
using system::SolidRef;
using system::VelocitySolver;
using system::VelocitySystem;

namespace {

constexpr double kOfAssembled = sizeof(Real) == 8 ? 1e-11 : 2e-5;
constexpr double kDt = 0.01;

// Two balls that share nodes, one of them damped, deformed a little; the first touches the floor.
struct Scene {
  grid::Grid g = cube_grid(14, 0.05);
  grid::Walls walls;
  std::vector<std::uint8_t> fixed;
  std::vector<Real> mass;
  TestSolid solids[2];
  VelocitySystem system;

  // The balls touch the walls and each other.
  explicit Scene(int threads = 1, system::StiffnessShares held = {}) {
    const auto soft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);
    const auto stiff = material::from_youngs_modulus(material::Law::kStableNeoHookean, 1e5, 0.4);
    solids[0] = make_ball(g, soft, {0.3, 0.11, 0.3}, 0.13);
    solids[1] = make_ball(g, stiff, {0.38, 0.35, 0.35}, 0.13);
    solids[1].rest.rayleigh_alpha = 3.0;
    solids[1].rest.rayleigh_beta = 0.004;
    fixed = grid::fixed_by_walls(g, walls);
    mass.assign(g.node_count(), static_cast<Real>(g.h * g.h * g.h));
    std::vector<SolidRef> refs;
    for (TestSolid& s : solids) {
      set_displacement(
          s, [](const Vec3d& x) { return Vec3d(0.01 * std::sin(9 * x[1]), 0.05 * x[2] * x[0], -0.03 * x[1]); });
      compute(s, 1, threads);
      for (std::size_t n = 0; n < mass.size(); ++n) mass[n] += s.work.mass[n];  // bands are the whole grid
      refs.push_back({&s.rest, &s.state, &s.work, {9.0, 9.0}, held, held});
    }
    system.assemble(Parallel(threads), g, fixed, refs, mass, {}, kDt);
  }
  std::vector<Real> random_vector(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Real> x(3 * static_cast<std::size_t>(system.unknowns()));
    for (Real& v : x) v = static_cast<Real>(normal(random));
    return x;
  }
  // G from the stiffness of each element, walls as identity rows and columns.
  Eigen::MatrixXd assembled() const {
    std::vector<int> unknown(g.node_count(), -1);
    for (std::size_t u = 0; u < system.nodes().size(); ++u) unknown[system.nodes()[u]] = static_cast<int>(u);
    const auto size = static_cast<Eigen::Index>(3 * system.unknowns());
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(size, size);
    const auto corner = grid::corner_offsets(g);
    for (const TestSolid& s : solids) {
      const double factor = kDt * kDt + kDt * s.rest.rayleigh_beta;
      for (std::size_t e = 0; e < s.work.element_cell.size(); ++e)
        for (int c = 0; c < 24; ++c) {
          Real in[24] = {}, out[24];
          in[c] = 1;
          solid::element_stiffness(s.work, g.h, e, in, out);
          const auto place = [&](int i) {
            return 3 * unknown[static_cast<std::size_t>(s.work.element_corner[e]) +
                               corner[static_cast<std::size_t>(i / 3)]] +
                   i % 3;
          };
          for (int r = 0; r < 24; ++r) m(place(r), place(c)) += factor * static_cast<double>(out[r]);
        }
      for (std::size_t u = 0; u < system.nodes().size(); ++u)
        for (Eigen::Index a = 0; a < 3; ++a)
          m(static_cast<Eigen::Index>(3 * u) + a, static_cast<Eigen::Index>(3 * u) + a) +=
              kDt * s.rest.rayleigh_alpha *
              (s.work.carries[system.nodes()[u]] ? static_cast<double>(s.work.mass[system.nodes()[u]]) : 0.0);
    }
    for (std::size_t u = 0; u < system.nodes().size(); ++u)
      for (unsigned a = 0; a < 3; ++a) {
        const auto i = static_cast<Eigen::Index>(3 * u + a);
        m(i, i) += static_cast<double>(mass[system.nodes()[u]]);
        if (!(fixed[system.nodes()[u]] & (1u << a))) continue;
        m.row(i).setZero();
        m.col(i).setZero();
        m(i, i) = 1.0;
      }
    return m;
  }
};

}  // namespace

TEST_CASE("The matrix-free G is the assembled one, symmetric and positive definite") {
  Scene scene;
  const Eigen::MatrixXd g = scene.assembled();
  REQUIRE(g.rows() == 3 * scene.system.unknowns());
  CHECK((g - g.transpose()).norm() < kOfAssembled * g.norm());
  const std::vector<Real> x = scene.random_vector(51), z = scene.random_vector(52);
  std::vector<Real> y(x.size()), w(x.size());
  scene.system.apply(Parallel(1), x, y);
  scene.system.apply(Parallel(1), z, w);
  const Eigen::VectorXd expected = g * to_vector(x);
  CHECK((to_vector(y) - expected).norm() < kOfAssembled * expected.norm());
  CHECK(to_vector(x).dot(to_vector(y)) > 0.0);
  // <G x, z> = <x, G z> on the components that walls leave free.
  const Eigen::VectorXd f = to_vector(scene.system.free());
  const Eigen::VectorXd xf = f.cwiseProduct(to_vector(x)), zf = f.cwiseProduct(to_vector(z));
  CHECK(f.sum() < static_cast<double>(f.size()));
  CHECK(zf.dot(g * xf) == Approx(xf.dot(g * zf)).epsilon(100 * kOfAssembled));
}

TEST_CASE("Both velocity solvers find the solution of a direct solve") {
  Scene scene;
  std::vector<Real> b = scene.random_vector(53);
  for (std::size_t i = 0; i < b.size(); ++i) b[i] *= scene.system.free()[i];
  const Eigen::VectorXd exact = scene.assembled().ldlt().solve(to_vector(b));
  const double tolerance = sizeof(Real) == 8 ? 1e-9 : 1e-5;
  for (const auto solver : {VelocitySolver::kPcg, VelocitySolver::kPcr}) {
    std::vector<Real> x(b.size(), 0);
    const auto stats = scene.system.solve(Parallel(1), solver, b, x, tolerance);
    CHECK(stats.converged);
    CHECK((to_vector(x) - exact).norm() < 300.0 * tolerance * exact.norm());
  }
}

TEST_CASE("A residual that counts as nothing ends a velocity solve") {
  Scene scene;
  std::vector<Real> b = scene.random_vector(59), half(b.size(), 0), none = half, left;
  for (std::size_t i = 0; i < b.size(); ++i) b[i] *= scene.system.free()[i];
  const double size = to_vector(b).norm();
  CHECK(scene.system.solve(Parallel(1), VelocitySolver::kPcg, b, none, 1e-3, 1.001 * size).iterations == 0);
  CHECK(to_vector(none).norm() == 0.0);
  const auto stats = scene.system.solve(Parallel(1), VelocitySolver::kPcg, b, half, 1e-3, 0.5 * size);
  CHECK(stats.converged);
  CHECK(stats.iterations > 0);
  scene.system.apply(Parallel(1), half, left);
  const double residual = (to_vector(b) - to_vector(left)).norm();
  CHECK(residual < 0.5 * size);
  CHECK(residual > 1e-3 * size);
}

TEST_CASE("What is prescribed stands on the right; what is tied moves with what it is tied to") {
  Scene scene;
  const double tolerance = sizeof(Real) == 8 ? 1e-9 : 1e-5;
  const std::vector<Real> b = scene.random_vector(57), x0 = scene.random_vector(58);
  std::vector<Real> all(b.size());
  const auto size = static_cast<Eigen::Index>(b.size());
  Eigen::MatrixXd g(size, size);  // G, whatever walls fix
  for (Eigen::Index i = 0; i < size; ++i) {
    std::vector<Real> unit(b.size(), 0);
    unit[static_cast<std::size_t>(i)] = 1;
    scene.system.multiply(Parallel(1), unit, all);
    g.col(i) = to_vector(all);
  }
  const std::size_t inside = 150, other = 200, late = 220;  // unknowns that no wall fixes
  REQUIRE(scene.system.free()[3 * inside + 1] > 0);
  REQUIRE(scene.system.free()[3 * other + 2] > 0);
  scene.system.fix(inside, 1);
  scene.system.tie(other, other + 1, 2);
  scene.system.tie(inside + 1, inside, 1);  // to what is prescribed, and to what is prescribed after that
  scene.system.tie(late + 1, late, 0);
  scene.system.fix(late, 0);
  // x = P y + what is given, y without what is prescribed or tied: P^T G P y = P^T (b - G given).
  Eigen::MatrixXd p = Eigen::MatrixXd::Identity(size, size);
  Eigen::VectorXd given = Eigen::VectorXd::Zero(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    if (scene.system.free()[static_cast<std::size_t>(i)] > 0) continue;
    p(i, i) = 0.0;
    if (scene.system.moves()[static_cast<std::size_t>(i)] > 0) continue;
    given[i] = static_cast<double>(x0[static_cast<std::size_t>(i)]);
  }
  const auto entry = [](std::size_t unknown, std::size_t axis) {
    return static_cast<Eigen::Index>(3 * unknown + axis);
  };
  given[entry(inside + 1, 1)] = given[entry(inside, 1)];
  given[entry(late + 1, 0)] = given[entry(late, 0)];
  p(static_cast<Eigen::Index>(3 * other + 2), static_cast<Eigen::Index>(3 * (other + 1) + 2)) = 1.0;
  const Eigen::MatrixXd reduced = p.transpose() * g * p;
  const Eigen::VectorXd y = reduced.completeOrthogonalDecomposition().solve(p.transpose() * (to_vector(b) - g * given));
  const Eigen::VectorXd exact = p * y + given;
  std::vector<Real> x = x0;
  const auto stats = scene.system.solve(Parallel(1), VelocitySolver::kPcg, b, x, tolerance);
  CHECK(stats.converged);
  CHECK((to_vector(x) - exact).norm() < 300.0 * tolerance * exact.norm());
}

TEST_CASE("Internal forces of a solid in the open sum to zero", "[law]") {
  Scene scene;
  std::vector<Real> force;
  scene.system.internal_force(Parallel(1), force);
  Vec3d sum = Vec3d::Zero(), size = Vec3d::Zero();
  for (std::size_t u = 0; u < force.size() / 3; ++u) {
    const Vec3d f(force[3 * u], force[3 * u + 1], force[3 * u + 2]);
    sum += f;
    size += f.cwiseAbs();
  }
  for (int a = 0; a < 3; ++a) CHECK(std::abs(sum[a]) < kOfAssembled * size[a]);
  CHECK(size.minCoeff() > 0.0);
}

TEST_CASE("Gather and scatter are inverse to each other on the unknowns") {
  Scene scene;
  const std::vector<Real> x = scene.random_vector(54);
  grid::VectorField field;
  system::SlipNodes slip;
  field.assign(scene.g.node_count(), 7);
  scene.system.scatter(Parallel(1), x, field, slip);
  std::vector<Real> y;
  scene.system.gather(Parallel(1), field, slip, y);
  CHECK(x == y);
  std::size_t untouched = 0;
  for (Real v : field.c[0]) untouched += v == 7;
  CHECK(untouched == scene.g.node_count() - static_cast<std::size_t>(scene.system.unknowns()));
}

TEST_CASE("The velocity system gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  std::vector<Real> first;
  for (int threads : {1, 2, 3, 8}) {
    Scene scene(threads);
    std::vector<Real> b = scene.random_vector(55), x(b.size(), 0);
    scene.system.solve(Parallel(threads), VelocitySolver::kPcg, b, x, 1e-3);
    if (first.empty()) first = x;
    CHECK(x == first);
  }
}

TEST_CASE("The share of the stiffness behind is that of the old velocity") {
  Scene scene(2, {0.9, 0.3}), stiffer(2, {1.2, 0.0});
  std::vector<Real> x = scene.random_vector(56);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= scene.system.free()[i];  // nodes on walls are at rest
  std::vector<Real> y, z, f(x.size(), 1);
  scene.system.apply(Parallel(2), x, y);
  stiffer.system.apply(Parallel(2), x, z);
  scene.system.add_past_stiffness(Parallel(2), x, f);
  // On the components that walls leave free; elsewhere it is what the wall has to push.
  const Eigen::VectorXd added = to_vector(f) - Eigen::VectorXd::Ones(static_cast<Eigen::Index>(f.size())),
                        left = added - (to_vector(z) - to_vector(y)), open = to_vector(scene.system.free());
  CHECK(open.cwiseProduct(left).norm() < 100 * kOfAssembled * added.norm());
  stiffer.system.add_past_stiffness(Parallel(2), x, f = x);
  CHECK(f == x);
}

TEST_CASE(
    "A step is nearly undamped where it resolves elastic waves and strains little, backward Euler where it is long") {
  const auto steady = system::stiffness_shares(0.5, 0.01, 1.0);
  CHECK(steady.ahead == steady.behind);
  CHECK(steady.memory > 0.0);
  const double inf = std::numeric_limits<double>::infinity();
  for (const auto& held : {system::stiffness_shares(0.5, inf, 1.0), system::stiffness_shares(0.5, 0.01, 3.0)}) {
    CHECK(held.ahead == Approx(0.6));
    CHECK(held.behind == 0.0);
    CHECK(held.memory == 0.0);
  }
  const auto slow = system::stiffness_shares(12.5, 0.01, 1.0);
  CHECK(slow.ahead == 1.0);
  CHECK(slow.behind == 0.0);
  for (double pace : {0.0, 1.3, 1.7, 2.4, 2.6})
    for (double strain : {0.0, 0.11, 0.15, 1.0}) {
      const auto shares = system::stiffness_shares(pace, strain, 1.0);
      CHECK(shares.ahead + shares.behind >= 0.5);                 // stable
      CHECK(shares.ahead - shares.behind + shares.memory > 0.0);  // damped
    }
}

TEST_CASE(
    "On walls a step is the more damped the more the solid is strained, and always where its surface cuts cells") {
  const auto rests = system::stiffness_shares_on_walls(0.5, 1.0, 0.1);
  CHECK(rests.ahead == rests.behind);
  CHECK(rests.memory > system::stiffness_shares(0.5, 0.0, 1.0).memory);  // its shortest waves more than in flight
  const auto pressed = system::stiffness_shares_on_walls(0.5, 1.0, 0.6),
             crushed = system::stiffness_shares_on_walls(0.5, 1.0, 0.8);
  CHECK(pressed.behind == Approx(0.5 * rests.behind));
  CHECK(crushed.ahead == Approx(0.6));
  CHECK(crushed.behind == 0.0);

  const Scene s;
  TestSolid ball = make_ball(s.g, s.solids[0].rest.elastic, {0.3, 0.11, 0.3}, 0.13);
  compute(ball, 1, 1);
  VelocitySystem system;
  const std::vector<SolidRef> refs = {{&ball.rest, &ball.state, &ball.work, {9.0, 9.0}, {0.5, 0.5}, {1.0, 0.0}}};
  system.assemble(Parallel(1), s.g, s.fixed, refs, ball.work.mass, {}, kDt);
  REQUIRE(system.fixed_axes(0) == 2);
  std::size_t cut = 0, inside = 0;
  for (std::size_t e = 0; e < ball.work.element_cell.size(); ++e) {
    const bool full = ball.work.fraction[static_cast<std::size_t>(ball.work.element_cell[e])] > Real(0.999999);
    ++(full ? inside : cut);
    CHECK(system.stiffness_factor(0, e) == Approx((full ? 0.5 : 1.0) * kDt * kDt));
  }
  CHECK(inside > 20);
  CHECK(cut > 20);
}

TEST_CASE("An element that is off its volume by half is viscous, one that an impact squeezes is not") {
  for (const double volume : {0.72, 1.0, 1.39}) CHECK(system::crushed_viscosity(volume, false) == 0.0);
  CHECK(system::crushed_viscosity(1.45, false) == Approx(15.0));
  for (const double volume : {0.1, 0.66, 1.51, 10.0}) CHECK(system::crushed_viscosity(volume, false) == Approx(30.0));
  for (const double volume : {0.92, 1.0, 1.09}) CHECK(system::crushed_viscosity(volume, true) == 0.0);
  CHECK(system::crushed_viscosity(1.15, true) == Approx(15.0));
  for (const double volume : {0.1, 0.83, 1.21, 10.0}) CHECK(system::crushed_viscosity(volume, true) == Approx(30.0));

  const Scene s;
  TestSolid block = make_ball(s.g, s.solids[0].rest.elastic, {0.3, 0.3, 0.3}, 0.13);
  set_displacement(block, [](const Vec3d& x) -> Vec3d { return 0.14 * (x - Vec3d(0.3, 0.3, 0.3)); });  // J 1.57
  compute(block, 1, 1);
  for (const bool keeps : {false, true}) {
    std::vector<SolidRef> refs = {{&block.rest, &block.state, &block.work, {1.0, 0.0}, {}, {}}};
    refs[0].keeps_volume = keeps;
    VelocitySystem system;
    system.assemble(Parallel(1), s.g, s.fixed, refs, block.work.mass, {}, kDt);
    REQUIRE(!block.work.element_cell.empty());
    for (std::size_t e = 0; e < block.work.element_cell.size(); ++e)
      CHECK(system.stiffness_factor(0, e) == Approx((keeps ? 31.0 : 1.0) * kDt * kDt));
  }
}

TEST_CASE("An oscillator keeps its energy where steps resolve it and loses it where they do not, as HHT-alpha does",
          "[law]") {
  const auto s = system::stiffness_shares(0.5, 0.01, 1.0);
  // Amplitude kept in a step of length 1 by an oscillator of frequency omega: over many steps, its phase left out.
  const auto kept = [&](double omega) {
    const double k = omega * omega;
    double u = 1.0, v = 0.0, change = 0.0, first = 0.0, last = 0.0;
    constexpr int kSteps = 4000, kPart = 400;
    for (int n = 0; n < kSteps; ++n) {
      const double next = ((1.0 + s.behind * k) * v - k * u - s.memory * k * change) / (1.0 + s.ahead * k);
      change = next - v;
      const double mean = 0.5 * (v + next), middle = u + 0.25 * change;  // both of the middle of the step
      const double energy = 0.5 * mean * mean + 0.5 * k * middle * middle;
      if (n < kPart) first = std::max(first, energy);
      if (n >= kSteps - kPart) last = std::max(last, energy);
      v = next;
      u += v;
    }
    return std::pow(last / first, 0.5 / (kSteps - kPart));
  };
  const double period = 2.0 * 3.14159265358979;
  CHECK(std::pow(kept(period / 40.0), 2.0 * 400.0) > 0.97);  // energy after ten periods of 40 steps
  for (const double omega : {0.01, 0.1, 1.0, 2.0, 10.0, 100.0}) {
    CHECK(kept(omega) <= 1.0 + 1e-9);
    if (omega >= 10.0) CHECK(kept(omega) < 0.93);  // (1 - alpha) / (1 + alpha) = 0.905 for the stiffest
  }
}
