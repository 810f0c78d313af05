// Purpose: preconditioned conjugate residuals, the paper's solver (Section 5), for symmetric semi-definite systems.
// Paper: Sec. 5 (PCR with a Jacobi preconditioner).
#pragma once

#include "base/parallel.hpp"
#include "linalg/solve_stats.hpp"

namespace efsi::linalg {

struct PcrWorkspace {
  std::vector<Real> r, z, p, az, ap, mp;
};

// inverse_diagonal: the Jacobi preconditioner. x: in start, out solution.
SolveStats pcr(const Parallel& parallel, const Operator& apply, const std::vector<Real>& inverse_diagonal,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcrWorkspace& work);

}  // namespace efsi::linalg
