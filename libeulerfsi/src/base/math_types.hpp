// Purpose: scalar and small-vector types. Fields hold Real (float; double in the double-precision test build),
// reductions and geometry use double.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>

namespace efsi {

#ifdef EFSI_DOUBLE
using Real = double;
#else
using Real = float;
#endif

using Vec3 = Eigen::Matrix<Real, 3, 1>;
using Mat3 = Eigen::Matrix<Real, 3, 3>;
using Vec3d = Eigen::Vector3d;
using Mat3d = Eigen::Matrix3d;
using Vec3i = std::array<int, 3>;

}  // namespace efsi
