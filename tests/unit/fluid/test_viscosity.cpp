// The viscous stiffness of the fluid's cells, and the implicit step.
#include <catch2/catch.hpp>
#include <random>

#include "fluid/viscosity.hpp"
#include "linalg/reduce.hpp"

using namespace efsi;
using namespace efsi::fluid;
using grid::Grid;

namespace {

Grid make_grid(Vec3i cells, std::array<bool, 3> periodic = {false, false, false}) {
  Grid g;
  g.cells = cells;
  g.h = 0.1;
  g.periodic = periodic;
  return g;
}

template <class Value>
std::vector<Real> sample(const Grid& g, const Value& value) {
  std::vector<Real> x(3 * g.node_count());
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const auto [i, j, k] = g.node_place(n);
    const Vec3d v = value(Vec3d(i, j, k));
    for (std::size_t c = 0; c < 3; ++c) x[c * g.node_count() + n] = static_cast<Real>(v[static_cast<Eigen::Index>(c)]);
  }
  return x;
}

std::vector<Real> random_values(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Real> x(n);
  for (Real& v : x) v = static_cast<Real>(normal(random));
  return x;
}

std::vector<Real> force(const Grid& g, const std::vector<std::uint8_t>& solid, const std::vector<Real>& x,
                        int threads = 1) {
  std::vector<Real> y;
  viscous_force(Parallel(threads), g, solid, x, y);
  return y;
}

}  // namespace

TEST_CASE("The viscous stiffness is that of int |grad v|^2 plus the square of the mean gradient", "[viscosity]") {
  const Grid g = make_grid({1, 1, 1});
  const std::vector<Real> x = random_values(24, 3), y = random_values(24, 4);
  // Gauss points integrate the products of trilinear gradients exactly.
  double exact = 0.0;
  Mat3d mean_x = Mat3d::Zero(), mean_y = Mat3d::Zero();
  const auto gradient = [&](const std::vector<Real>& v, const Vec3d& at) {
    Mat3d sum = Mat3d::Zero();
    for (std::size_t a = 0; a < 8; ++a) {
      const auto& corner = grid::kCorner[a];
      const std::size_t n = g.node(corner[0], corner[1], corner[2]);
      Vec3d shape;
      for (int d = 0; d < 3; ++d) {
        shape[d] = corner[d] ? 1.0 : -1.0;
        for (int e = 0; e < 3; ++e)
          if (e != d) shape[d] *= corner[e] ? at[e] : 1.0 - at[e];
      }
      for (std::size_t c = 0; c < 3; ++c)
        sum.row(static_cast<Eigen::Index>(c)) += static_cast<double>(v[8 * c + n]) * shape.transpose();
    }
    return sum;
  };
  for (int q = 0; q < 8; ++q) {
    const double s = 0.5 / std::sqrt(3.0);
    const Vec3d at = Vec3d::Constant(0.5) + s * Vec3d(q & 1 ? 1 : -1, q & 2 ? 1 : -1, q & 4 ? 1 : -1);
    exact += gradient(x, at).cwiseProduct(gradient(y, at)).sum() / 8.0;
    mean_x += gradient(x, at) / 8.0;
    mean_y += gradient(y, at) / 8.0;
  }
  exact += mean_x.cwiseProduct(mean_y.transpose()).sum();
  const std::vector<Real> kx = force(g, {}, x), ky = force(g, {}, y);
  CHECK(linalg::dot(Parallel(), kx, y) == Approx(exact).epsilon(1e-5));
  CHECK(linalg::dot(Parallel(), ky, x) == Approx(exact).epsilon(1e-5));
}

TEST_CASE("A rigid motion has no viscous force, and the force sums to nothing", "[viscosity]") {
  const Grid g = make_grid({5, 4, 6});
  const auto rigid = sample(g, [](const Vec3d& x) { return Vec3d(Vec3d(1, 2, 3) + Vec3d(0.3, -0.5, 0.2).cross(x)); });
  std::vector<std::uint8_t> solid(g.padded_count(), 0);
  for (int k = 1; k < 4; ++k) solid[g.padded(2, 2, k)] = 1;
  double largest = 0.0;
  for (const Real f : force(g, solid, rigid)) largest = std::max(largest, std::abs(static_cast<double>(f)));
  CHECK(largest < 1e-5);
  const std::vector<Real> y = force(g, solid, random_values(3 * g.node_count(), 1));
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (std::size_t n = 0; n < g.node_count(); ++n) sum += static_cast<double>(y[c * g.node_count() + n]);
    CHECK(std::abs(sum) < 1e-4);
  }
  CHECK(force(g, solid, random_values(3 * g.node_count(), 1), 3) == y);
}

TEST_CASE("A viscous step takes energy and keeps momentum, in a box of periodic axes, at any size", "[viscosity]") {
  const Grid g = make_grid({6, 5, 4}, {true, true, true});
  const std::vector<std::uint8_t> fixed(g.node_count(), 0);
  ViscousWorkspace work;
  work.mass.assign(g.node_count(), Real(0.7));
  grid::VectorField v;
  v.assign(g.node_count());
  const std::vector<Real> noise = random_values(3 * g.node_count(), 5);
  const auto original = [&](std::size_t n) {
    Vec3i at = g.node_place(n);
    for (std::size_t a = 0; a < 3; ++a) at[a] %= g.cells[a];
    return g.node(at[0], at[1], at[2]);
  };
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t n = 0; n < g.node_count(); ++n) v.c[c][n] = noise[c * g.node_count() + original(n)];
  const auto measure = [&](Vec3d& momentum) {
    double energy = 0.0;
    momentum.setZero();
    for (std::size_t n = 0; n < g.node_count(); ++n)
      if (original(n) == n) {
        momentum += v.at(n).cast<double>();
        energy += v.at(n).cast<double>().squaredNorm();
      }
    return energy;
  };
  Vec3d before, after;
  double energy = measure(before);
  for (const double viscosity : {0.1, 10.0, 1e4}) {
    CHECK(diffuse(Parallel(), g, {fixed, {}, viscosity, 0.1, v}, v, work).converged);
    const double now = measure(after);
    CHECK(now < energy);
    energy = now;
    CHECK((after - before).norm() < 1e-2);
    bool same = true;
    for (std::size_t n = 0; n < g.node_count(); ++n) same = same && v.at(n) == v.at(original(n));
    CHECK(same);
  }
  CHECK(energy - before.squaredNorm() / 120.0 < 0.02 * energy + 1e-3);  // it flows as one
}
