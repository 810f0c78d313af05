// Purpose: what the tests of elements share: size and stiffness of their blocks, rotations.
#pragma once

#include <Eigen/Geometry>

#include "material/constitutive.hpp"

namespace efsi::test {

constexpr double kH = 0.05;  // size of the cells [m]
inline const material::Elastic kSoft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);

inline Mat3d rotation(double angle, const Vec3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

}  // namespace efsi::test
