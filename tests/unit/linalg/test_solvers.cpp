// Purpose: conjugate gradients and conjugate residuals against a direct solve; reductions for any thread count.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "linalg/jacobi.hpp"
#include "linalg/pcg.hpp"
#include "linalg/pcr.hpp"
#include "linalg/reduce.hpp"

using namespace efsi;
using namespace efsi::linalg;

namespace {

constexpr double kTolerance = sizeof(Real) == 8 ? 1e-11 : 1e-5;

// A dense symmetric matrix with eigenvalues between 1 and `condition`.
struct DenseSystem {
  Eigen::MatrixXd a;
  std::vector<Real> b, inverse_diagonal;
  Eigen::VectorXd exact;

  DenseSystem(int n, double condition) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    Eigen::MatrixXd m(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) m(i, j) = normal(random);
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(m).householderQ();
    Eigen::VectorXd values(n), rhs(n);
    for (int i = 0; i < n; ++i) {
      values[i] = std::pow(condition, static_cast<double>(i) / (n - 1));
      rhs[i] = normal(random);
    }
    a = q * values.asDiagonal() * q.transpose();
    exact = a.ldlt().solve(rhs);
    for (int i = 0; i < n; ++i) {
      b.push_back(static_cast<Real>(rhs[i]));
      inverse_diagonal.push_back(static_cast<Real>(1.0 / a(i, i)));
    }
  }
  void apply(const std::vector<Real>& x, std::vector<Real>& y) const {
    Eigen::VectorXd v(a.rows());
    for (Eigen::Index i = 0; i < a.rows(); ++i) v[i] = static_cast<double>(x[static_cast<std::size_t>(i)]);
    const Eigen::VectorXd w = a * v;
    for (Eigen::Index i = 0; i < a.rows(); ++i) y[static_cast<std::size_t>(i)] = static_cast<Real>(w[i]);
  }
  double error(const std::vector<Real>& x) const {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < a.rows(); ++i)
      sum += std::pow(static_cast<double>(x[static_cast<std::size_t>(i)]) - exact[i], 2);
    return std::sqrt(sum) / exact.norm();
  }
};

SolveStats run_pcg(const DenseSystem& s, std::vector<Real>& x, const SolveOptions& options) {
  const Parallel parallel(1);
  PcgWorkspace work;
  return pcg(
      parallel, [&](const auto& in, auto& out) { s.apply(in, out); }, jacobi(parallel, s.inverse_diagonal), s.b, x,
      options, work);
}

SolveStats run_pcr(const DenseSystem& s, std::vector<Real>& x, const SolveOptions& options) {
  const Parallel parallel(1);
  PcrWorkspace work;
  return pcr(
      parallel, [&](const auto& in, auto& out) { s.apply(in, out); }, jacobi(parallel, s.inverse_diagonal), s.b, x,
      options, work);
}

}  // namespace

TEST_CASE("Both solvers find the solution of a direct solve") {
  const DenseSystem system(60, 50.0);
  SolveOptions options;
  options.tolerance = kTolerance;
  for (auto* run : {&run_pcg, &run_pcr}) {
    std::vector<Real> x(60, 0);
    const SolveStats stats = run(system, x, options);
    CHECK(stats.converged);
    CHECK(stats.residual <= kTolerance);
    CHECK(stats.iterations > 5);
    CHECK(system.error(x) < 50.0 * 2.0 * kTolerance);
    // A solve that starts at the solution has nothing to do.
    options.tolerance = 20.0 * kTolerance;
    CHECK(run(system, x, options).iterations == 0);
    options.tolerance = kTolerance;
  }
}

TEST_CASE("The residual of conjugate residuals never grows, the energy error of conjugate gradients never grows") {
  const DenseSystem system(60, 200.0);
  SolveOptions options;
  options.tolerance = 1e-12;
  double last_residual = 1.0, last_energy = 1e300;
  for (int n = 1; n <= 20; ++n) {
    options.max_iterations = n;
    std::vector<Real> x(60, 0), y(60, 0);
    const SolveStats stats = run_pcr(system, x, options);
    CHECK(stats.iterations == n);
    CHECK_FALSE(stats.converged);
    // Jacobi-preconditioned: the norm that shrinks is that of the scaled residual, the plain one up to a factor.
    CHECK(stats.residual <= 1.2 * last_residual);
    last_residual = stats.residual;
    run_pcg(system, y, options);
    Eigen::VectorXd e = system.exact;
    for (int i = 0; i < 60; ++i) e[i] -= static_cast<double>(y[static_cast<std::size_t>(i)]);
    const double energy = e.dot(system.a * e);
    CHECK(energy <= 1.0001 * last_energy);
    last_energy = energy;
  }
}

TEST_CASE("A zero right-hand side gives zero at once") {
  DenseSystem system(20, 10.0);
  system.b.assign(20, 0);
  for (auto* run : {&run_pcg, &run_pcr}) {
    std::vector<Real> x(20, 3);
    const SolveStats stats = run(system, x, {});
    CHECK(stats.converged);
    CHECK(stats.iterations == 0);
    CHECK(x == std::vector<Real>(20, 0));
  }
}

TEST_CASE("An indefinite matrix is reported, not hidden") {
  DenseSystem system(20, 10.0);
  system.a = -system.a;
  for (auto* run : {&run_pcg, &run_pcr}) {
    std::vector<Real> x(20, 0);
    const SolveStats stats = run(system, x, {});
    CHECK_FALSE(stats.converged);
    for (Real v : x) CHECK(std::isfinite(v));
  }
}

TEST_CASE("A right-hand side that is not a number is not taken for a zero one") {
  DenseSystem system(20, 10.0);
  system.b[7] = std::numeric_limits<Real>::quiet_NaN();
  for (auto* run : {&run_pcg, &run_pcr}) {
    std::vector<Real> x(20, 3);
    CHECK_FALSE(run(system, x, {}).converged);
  }
}

TEST_CASE("A further demand on the residual is met before a solver stops") {
  const DenseSystem system(60, 50.0);
  SolveOptions options;
  options.tolerance = 0.5;
  std::vector<Real> x(60, 0);
  const int plain = run_pcg(system, x, options).iterations;
  options.also = [](const std::vector<Real>& r) { return std::abs(r[0]) < Real(1e-3); };
  for (auto* run : {&run_pcg, &run_pcr}) {
    x.assign(60, 0);
    const SolveStats stats = run(system, x, options);
    CHECK(stats.converged);
    CHECK(stats.iterations > plain);
  }
}

TEST_CASE("Reductions and vector updates give the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  std::vector<Real> a(23457), b(23457);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<Real>(normal(random));
    b[i] = static_cast<Real>(normal(random));
  }
  const Parallel one(1);
  const double expected = dot(one, a, b), length = norm(one, a);
  std::vector<Real> y1 = b, y2 = b, y3(b.size());
  add_scaled(one, y1, 0.3, a);
  scale_add(one, y2, 0.7, a);
  multiply(one, y3, b, a);
  std::vector<Real> turned = b;
  const double along = turn(one, turned, 0.7, a, y1);
  CHECK(turned == y2);
  CHECK(along == dot(one, y2, y1));
  double plain = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) plain += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  CHECK(expected == Approx(plain).epsilon(1e-9));
  for (int threads : {2, 3, 8}) {
    const Parallel parallel(threads);
    CHECK(dot(parallel, a, b) == expected);
    CHECK(norm(parallel, a) == length);
    std::vector<Real> z1 = b, z2 = b, z3(b.size());
    add_scaled(parallel, z1, 0.3, a);
    scale_add(parallel, z2, 0.7, a);
    multiply(parallel, z3, b, a);
    CHECK(z1 == y1);
    CHECK(z2 == y2);
    CHECK(z3 == y3);
    std::vector<Real> z4 = b;
    CHECK(turn(parallel, z4, 0.7, a, y1) == along);
    CHECK(z4 == y2);
  }
}
