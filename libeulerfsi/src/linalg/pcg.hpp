// Purpose: preconditioned conjugate gradients, flexible (Polak-Ribiere), for A x = b with A symmetric positive
// semi-definite and b in its range. It minimises the energy norm of the error.
#pragma once

#include "base/parallel.hpp"
#include "linalg/solve_stats.hpp"

namespace efsi::linalg {

struct PcgWorkspace {
  std::vector<Real> r, z, d, q, best;
  std::size_t bytes() const { return (r.size() + z.size() + d.size() + q.size() + best.size()) * sizeof(Real); }
};

// x: in start, out solution. precondition(r, z): z = B r. A result is always usable: on a negative curvature or a stall
// the best iterate so far stays in x and `converged` is false.
SolveStats pcg(const Parallel& parallel, const Operator& apply, const Operator& precondition,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcgWorkspace& work);

}  // namespace efsi::linalg
