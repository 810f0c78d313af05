// Purpose: what tests compare with dense algebra, as it takes it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::test {

inline Eigen::VectorXd to_vector(const std::vector<Real>& x) {
  const auto size = static_cast<Eigen::Index>(x.size());
  return Eigen::Map<const Eigen::Matrix<Real, Eigen::Dynamic, 1>>(x.data(), size).cast<double>();
}

}  // namespace efsi::test
