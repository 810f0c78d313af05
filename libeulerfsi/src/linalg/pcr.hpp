// Purpose: preconditioned conjugate residuals, the paper's solver (Section 5), for symmetric semi-definite systems. It
// minimises the residual in the norm of the preconditioner.
// Paper: Sec. 5 (PCR with a Jacobi preconditioner).
#pragma once

#include "base/parallel.hpp"
#include "linalg/solve_stats.hpp"

namespace efsi::linalg {

struct PcrWorkspace {
  std::vector<Real> r, z, p, az, ap, mp;
  std::size_t bytes() const {
    return (r.size() + z.size() + p.size() + az.size() + ap.size() + mp.size()) * sizeof(Real);
  }
};

// x: in start, out solution. precondition(r, z): z = B r.
SolveStats pcr(const Parallel& parallel, const Operator& apply, const Operator& precondition,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcrWorkspace& work);

}  // namespace efsi::linalg
