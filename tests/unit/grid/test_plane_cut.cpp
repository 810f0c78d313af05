// Purpose: the volume that a plane cuts from a cube.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "grid/plane_cut.hpp"

using namespace efsi;
using grid::plane_cut_fraction;

TEST_CASE("Planes along the axes cut linear parts") {
  for (int a = 0; a < 3; ++a)
    for (double d : {-0.6, -0.5, -0.25, 0.0, 0.1, 0.5, 0.7}) {
      Vec3d n = Vec3d::Zero();
      n[a] = 1.0;
      CHECK(plane_cut_fraction(d, n) == Approx(std::clamp(0.5 - d, 0.0, 1.0)).margin(1e-12));
    }
}

TEST_CASE("The plane across the diagonal cuts a tetrahedron") {
  const Vec3d n = Vec3d(1, 1, 1).normalized();
  for (double a : {0.1, 0.5, 1.0})  // x + y + z < a, measured from the corner
    CHECK(plane_cut_fraction((1.5 - a) / std::sqrt(3.0), n) == Approx(a * a * a / 6.0).margin(1e-12));
  CHECK(plane_cut_fraction(0.0, n) == Approx(0.5));
}

TEST_CASE("Random planes: the closed form is the sampled volume, and the two sides fill the cube") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> offset(-0.8, 0.8);
  for (int trial = 0; trial < 60; ++trial) {
    Vec3d n(normal(random), normal(random), trial % 5 == 0 ? 0.0 : normal(random));
    n.normalize();
    const double d = offset(random);
    constexpr int kSamples = 40;
    int inside = 0;
    for (int k = 0; k < kSamples; ++k)
      for (int j = 0; j < kSamples; ++j)
        for (int i = 0; i < kSamples; ++i)
          inside += n.dot((Vec3d(i, j, k) + Vec3d::Constant(0.5)) / kSamples - Vec3d::Constant(0.5)) + d < 0.0;
    const double fraction = plane_cut_fraction(d, n);
    CHECK(fraction == Approx(inside / std::pow(kSamples, 3)).margin(5e-3));
    CHECK(fraction + plane_cut_fraction(-d, n) == Approx(1.0).margin(1e-9));
    CHECK(fraction == Approx(plane_cut_fraction(d, Vec3d(-n[2], n[0], -n[1]))).margin(1e-9));
    CHECK(plane_cut_fraction(d + 1e-3, n) <= fraction + 1e-12);
  }
}

TEST_CASE("Planes nearly along an axis cut what those along it cut, whichever way they lean", "[law]") {
  for (const double lean : {0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4})
    for (const double other : {0.0, 1e-9, 1e-7, 1e-5})
      for (const double d : {-0.499, -0.3, 0.0, 0.2, 0.4999}) {
        const double upright = plane_cut_fraction(d, Vec3d(lean, 1.0, other).normalized());
        CHECK(upright == Approx(0.5 - d).margin(lean + other + 1e-14));
        CHECK(plane_cut_fraction(d, Vec3d(-lean, 1.0, other).normalized()) == upright);
        CHECK(plane_cut_fraction(d, Vec3d(other, 1.0, -lean).normalized()) == Approx(upright).margin(1e-14));
        CHECK(plane_cut_fraction(-d, Vec3d(lean, -1.0, other).normalized()) == Approx(1.0 - upright).margin(1e-14));
      }
}
