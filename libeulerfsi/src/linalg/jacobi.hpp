// Purpose: the Jacobi preconditioner.
#pragma once

#include "linalg/reduce.hpp"
#include "linalg/solve_stats.hpp"

namespace efsi::linalg {

// inverse_diagonal must outlive the operator.
inline Operator jacobi(const Parallel& parallel, const std::vector<Real>& inverse_diagonal) {
  return [&parallel, &inverse_diagonal](const std::vector<Real>& r, std::vector<Real>& z) {
    multiply(parallel, z, inverse_diagonal, r);
  };
}

}  // namespace efsi::linalg
