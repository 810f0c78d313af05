#include "solid/map/reference_map.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "solid/map/credible.hpp"

namespace efsi::solid {
namespace {

// squares: (F F^T)^-1, det: of F^-1
Deformation deformation_of(const Mat3d& squares, double det) {
  Deformation d;
  Eigen::SelfAdjointEigenSolver<Mat3d> eigen(squares);
  d.axes = eigen.eigenvectors();
  Vec3d inverse_stretch = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();  // ascending
  if (!(det > 0.0)) {  // inverted: the weakest direction is the one that turned over
    inverse_stretch[0] = -inverse_stretch[0];
    d.degenerate = true;
  }
  for (int i = 0; i < 3; ++i) {
    const double clamped = std::clamp(inverse_stretch[i], 1.0 / kElementStretch.most, 1.0 / kElementStretch.least);
    if (!(clamped == inverse_stretch[i])) d.degenerate = true;
    d.stretch[i] = 1.0 / clamped;
  }
  d.det = d.stretch.prod();
  const bool is_flat = d.stretch.minCoeff() < kPlausibleStretch.least || d.stretch.maxCoeff() > kPlausibleStretch.most;
  if (is_flat && !(d.det <= kFlatGrowth && d.det * kFlatGrowth >= 1.0)) d.degenerate = true;
  return d;
}

}  // namespace

Deformation deformation_from_displacement(const Mat3d& displacement_gradient) {
  const Mat3d inverse_f = Mat3d::Identity() - displacement_gradient;
  return deformation_of(inverse_f.transpose() * inverse_f, inverse_f.determinant());
}

Deformation elastic_deformation(const Mat3d& displacement_gradient, const Mat3d& plastic_metric) {
  const Mat3d inverse_f = Mat3d::Identity() - displacement_gradient;
  return deformation_of(inverse_f.transpose() * plastic_metric * inverse_f, inverse_f.determinant());
}

}  // namespace efsi::solid
