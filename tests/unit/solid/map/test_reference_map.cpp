// Purpose: the deformation gradient from the displacement gradient, and degenerate cases.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "solid/map/credible.hpp"
#include "solid/map/reference_map.hpp"

using namespace efsi;
using namespace efsi::solid;

TEST_CASE("Stretches and axes are those of F = (I - du/dx)^-1") {
  std::mt19937 random(21);
  std::uniform_real_distribution<double> entry(-0.35, 0.35);
  int tried = 0;
  while (tried < 100) {
    Mat3d gradient;
    for (int i = 0; i < 9; ++i) gradient.data()[i] = entry(random);
    const Mat3d f = (Mat3d::Identity() - gradient).inverse();
    const Eigen::JacobiSVD<Mat3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Vec3d s = svd.singularValues();  // descending
    if (f.determinant() <= 0 || s[0] > 4.9 || s[2] < 0.21) continue;
    ++tried;
    const Deformation d = deformation_from_displacement(gradient);
    CHECK_FALSE(d.degenerate);
    CHECK(d.det == Approx(f.determinant()).epsilon(1e-8));
    const Mat3d left = d.axes * d.stretch.cwiseAbs2().asDiagonal() * d.axes.transpose();
    CHECK((left - f * f.transpose()).norm() < 1e-8 * left.norm());
    CHECK((d.axes * d.axes.transpose() - Mat3d::Identity()).norm() < 1e-10);
  }
}

TEST_CASE("Inverted, collapsed and torn cells are marked and clamped") {
  const auto from_inverse = [](const Vec3d& diagonal) {
    return deformation_from_displacement(Mat3d::Identity() - Mat3d(diagonal.asDiagonal()));
  };
  CHECK_FALSE(from_inverse({1, 1, 1}).degenerate);
  CHECK_FALSE(from_inverse({0.25, 1, 4}).degenerate);
  CHECK_FALSE(from_inverse({0.15, 1, 7}).degenerate);  // flat, and as large as before
  CHECK(from_inverse({1, 1, 7}).degenerate);
  CHECK(from_inverse({0.15, 1, 1}).degenerate);
  for (const Vec3d& bad : {Vec3d(-1, 1, 1), Vec3d(0, 1, 1), Vec3d(-1, -1, -1), Vec3d(20, 1, 1), Vec3d(0.05, 1, 1),
                           Vec3d(0, 0, 0), Vec3d(0, -2, 30)}) {
    const Deformation d = from_inverse(bad);
    CHECK(d.degenerate);
    for (int i = 0; i < 3; ++i) {
      CHECK(d.stretch[i] >= kElementStretch.least * (1 - 1e-12));
      CHECK(d.stretch[i] <= kElementStretch.most * (1 + 1e-12));
    }
    CHECK(d.det > 0.0);
  }
}
