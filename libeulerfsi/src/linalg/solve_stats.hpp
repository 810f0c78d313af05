// Purpose: what every iterative solve reports, and when it stops.
#pragma once

#include <functional>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::linalg {

struct SolveStats {
  int iterations = 0;
  double residual = 0.0;  // relative, 2-norm
  bool converged = true;
};

struct SolveOptions {
  double tolerance = 1e-3;      // on |r| / |b|, 2-norm
  double reference = 0.0;       // in place of |b| where it is more than 0
  bool against_start = false;   // on |r| over that of the start instead, down to the rounding of b; pcg only
  double least = 0.0;           // lower bound of the tolerance on |r|; with against_start
  bool residual_known = false;  // r of the workspace is that of x at the start; pcg only
  int max_iterations = 500;
  int min_iterations = 0;  // made also when the start passes
  // Optional further demand on the residual, asked when the 2-norm has passed.
  std::function<bool(const std::vector<Real>& residual)> also;
};

using Operator = std::function<void(const std::vector<Real>& x, std::vector<Real>& y)>;

}  // namespace efsi::linalg
