// Purpose: trilinear interpolation and back-traces.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "grid/interpolate.hpp"

using namespace efsi;
using namespace efsi::grid;

namespace {

constexpr double kInterpolated = sizeof(Real) == 8 ? 1e-12 : 2e-5;

Grid box(int n) {
  Grid g;
  g.cells = {n, n, n};
  return g;
}

template <class F>
VectorField sampled(const Grid& g, const F& f) {
  VectorField field;
  field.assign(g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) field.set(g.node(i, j, k), Vec3(f(Vec3d(i, j, k)).template cast<Real>()));
  return field;
}

// Turns about the z axis through the middle of a box of 32^3 cells with angular velocity 1.
Vec3d turning(const Vec3d& x) { return {16.0 - x[1], x[0] - 16.0, 0.0}; }

// Distance between a trace by `angle` and the exact point.
template <class Trace>
double trace_error(const Trace& trace, double angle) {
  const Grid g = box(32);
  const VectorField v = sampled(g, turning);
  const NodeSampler sampler(g);
  const Vec3 from(24, 16, 16);
  const Vec3 to = trace(sampler, v, from, sampler.vector(v, from), static_cast<Real>(angle));
  const Vec3d exact(16.0 + 8.0 * std::cos(-angle), 16.0 + 8.0 * std::sin(-angle), 16.0);
  return (to.cast<double>() - exact).norm();
}

}  // namespace

TEST_CASE("Interpolation reproduces linear fields exactly") {
  Grid g;
  g.cells = {5, 7, 4};
  Mat3d a;
  a << 1, -2, 0.5, 0.3, 1.2, -0.7, 2, 0.1, -1;
  const Vec3d b(0.3, -1, 2);
  const VectorField field = sampled(g, [&](const Vec3d& x) -> Vec3d { return a * x + b; });
  const NodeSampler sampler(g);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3d x(5 * unit(random), 7 * unit(random), 4 * unit(random));
    const Vec3d value = sampler.vector(field, x.cast<Real>()).cast<double>();
    CHECK((value - (a * x + b)).norm() < 10 * kInterpolated);
    const Trilinear t = sampler.stencil(x.cast<Real>());
    CHECK(static_cast<double>(sampler.value(t, field.c[1].data())) == Approx(value[1]).margin(10 * kInterpolated));
    double sum = 0.0;
    for (Real w : t.w) {
      CHECK(w >= 0);
      sum += static_cast<double>(w);
    }
    CHECK(sum == Approx(1.0).margin(kInterpolated));
  }
  // On the far corner and beyond: the value of the corner.
  const Vec3d corner = a * Vec3d(5, 7, 4) + b;
  CHECK((sampler.vector(field, Vec3(5, 7, 4)).cast<double>() - corner).norm() < 10 * kInterpolated);
  CHECK((sampler.vector(field, Vec3(8, 9, 4.5)).cast<double>() - corner).norm() < 10 * kInterpolated);
}

TEST_CASE("Positions on periodic axes wrap") {
  Grid g = box(8);
  g.periodic = {true, false, true};
  const double w = 2.0 * 3.14159265358979323846 / 8.0;
  const VectorField field =
      sampled(g, [&](const Vec3d& x) { return Vec3d(std::sin(w * x[0]), x[1], std::cos(w * x[2])); });
  const NodeSampler sampler(g);
  for (double shift : {-24.0, -8.0, 8.0, 16.0}) {
    const Vec3 x(Real(1.3), Real(2.5), Real(6.75));
    const Vec3 y(x[0] + static_cast<Real>(shift), x[1], x[2] - static_cast<Real>(shift));
    CHECK((sampler.vector(field, x) - sampler.vector(field, y)).norm() < 10 * kInterpolated);
  }
  CHECK(static_cast<double>(wrap(Real(-0.25), Real(8))) == Approx(7.75));
  CHECK(static_cast<double>(wrap(Real(17), Real(8))) == Approx(1.0));
}

TEST_CASE("The back-trace in a rotation is third order, the midpoint rule second order") {
  const auto rk3 = [](auto&&... arguments) { return trace_rk3(arguments...); };
  const auto midpoint = [](auto&&... arguments) { return trace_midpoint(arguments...); };
  // One step of order p errs by angle^(p+1).
  const double order3 = std::log2(trace_error(rk3, 0.6) / trace_error(rk3, 0.3));
  const double order2 = std::log2(trace_error(midpoint, 0.6) / trace_error(midpoint, 0.3));
  CHECK(order3 == Approx(4.0).margin(0.15));
  CHECK(order2 == Approx(3.0).margin(0.15));
  CHECK(trace_error(rk3, 0.3) < 8.0 * std::pow(0.3, 4) / 24.0 * 1.1);
}

TEST_CASE("Tracing back and forth in a rotation returns to the start") {
  const Grid g = box(32);
  const VectorField v = sampled(g, turning);
  const NodeSampler sampler(g);
  const Vec3 x(20, 13, 9);
  const Vec3 back = trace_rk3(sampler, v, x, sampler.vector(v, x), Real(0.1));
  const Vec3 again = trace_rk3(sampler, v, back, sampler.vector(v, back), Real(-0.1));
  CHECK((back - x).norm() > Real(0.4));
  CHECK((again - x).norm() < Real(2e-4));
}
