// Purpose: sampling, gradient and volume of a sampled distance field.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "geometry/signed_distance.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

template <class Function>
SignedDistance sampled(const Vec3i& size, double spacing, const Vec3d& origin, const Function& phi) {
  SignedDistance grid{size, spacing, origin, {}};
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i) grid.values.push_back(static_cast<float>(phi(grid.node(i, j, k))));
  return grid;
}

// Volume of the unit cube below the plane n . X = d, all n > 0: corners in turn added and taken off.
double cube_below_plane(const Vec3d& n, double d) {
  double sum = 0.0;
  for (int c = 0; c < 8; ++c) {
    const Vec3d corner(c & 1, c >> 1 & 1, c >> 2 & 1);
    const double sign = static_cast<int>(corner.sum()) % 2 ? -1.0 : 1.0;
    sum += sign * std::pow(std::max(0.0, d - n.dot(corner)), 3);
  }
  return sum / (6.0 * n.prod());
}

}  // namespace

TEST_CASE("A linear field is sampled and differentiated exactly", "[law]") {
  const Vec3d slope(0.6, -0.3, 0.7);
  const auto phi = [&](const Vec3d& X) { return slope.dot(X) + 0.1; };
  const SignedDistance grid = sampled({9, 7, 11}, 0.25, {-1, 2, 0.5}, phi);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int n = 0; n < 200; ++n) {
    const double u = uniform(random), v = uniform(random), w = uniform(random);
    CHECK(grid.sample(grid.origin + Vec3d(2.0 * u, 1.5 * v, 2.5 * w)) ==
          Approx(phi(grid.origin + Vec3d(2.0 * u, 1.5 * v, 2.5 * w))).margin(1e-6));
    const Vec3d inner = grid.origin + Vec3d(0.125 + 1.75 * u, 0.125 + 1.25 * v, 0.125 + 2.25 * w);
    CHECK((grid.gradient(inner) - slope).norm() < 1e-5);
  }
}

TEST_CASE("Outside the grid the distance grows continuously from the border", "[law]") {
  const SignedDistance grid = sampled({21, 21, 21}, 0.1, {-1, -1, -1}, [](const Vec3d& X) { return X.norm() - 0.5; });
  const double border = grid.sample({1, 0.3, 0});
  CHECK(grid.sample({3, 0.3, 0}) == Approx(border + 2.0));
  CHECK(grid.sample({1 + 1e-9, 0.3, 0}) == Approx(border));
  CHECK(grid.sample({-4, -5, 1}) == Approx(grid.sample({-1, -1, 1}) + 5.0));
  CHECK((grid.gradient({3, 0, 0}) - Vec3d(1, 0, 0)).norm() < 1e-6);
  CHECK(grid.sample({1e300, 0, 0}) > 1e299);
  CHECK(std::isnan(grid.sample({std::numeric_limits<double>::quiet_NaN(), 0, 0})));
}

TEST_CASE("The volume below a plane is exact", "[law]") {
  for (const double d : {0.05, 0.3, 0.75, 1.1, 1.4}) {
    const Vec3d n(0.35, 0.2, 0.9);
    const SignedDistance one = sampled({2, 2, 2}, 1.0, {0, 0, 0}, [&](const Vec3d& X) { return n.dot(X) - d; });
    CHECK(one.volume() == Approx(cube_below_plane(n, d)).epsilon(1e-5));
    const SignedDistance many = sampled({9, 9, 9}, 0.125, {0, 0, 0}, [&](const Vec3d& X) { return n.dot(X) - d; });
    CHECK(many.volume() == Approx(cube_below_plane(n, d)).epsilon(1e-5));
  }
}

TEST_CASE("The volume of a sphere converges with the square of the spacing", "[law]") {
  const double exact = 4.0 / 3.0 * std::numbers::pi * 0.125;
  double previous = 0.0;
  for (const int n : {9, 17, 33, 65}) {
    const SignedDistance grid =
        sampled({n + 1, n + 1, n + 1}, 1.4 / n, {-0.7, -0.7, -0.7}, [](const Vec3d& X) { return X.norm() - 0.5; });
    const double error = std::abs(grid.volume() - exact);
    CHECK(error < exact * 5.0 / (n * n));
    if (previous > 0.0) CHECK(previous / error > 3.0);
    previous = error;
  }
}
