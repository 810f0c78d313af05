// Purpose: one nonlinear conjugate gradient descent for Eq. 8 with rows of contact whose multipliers are given: rows
// open, stick and slide in every iteration, none of which costs more than one product with G.
// The residual f + B^T r(x) - G x, r(x) what the rows do at x (system/contact_row.hpp), is the slope of a convex
// function as long as the limits of friction stay. Polak-Ribiere, preconditioned with the penalties of the rows that
// are closed (docs/numerics/solid-contact.md).
#pragma once

#include <vector>

#include "linalg/solve_stats.hpp"
#include "system/contact_row.hpp"

namespace efsi::system {

// What of the residual may be left: the larger of both.
struct Target {
  double least = 0.0;       // [kg m/s]
  double of_impulse = 0.0;  // relative to |B^T r(x)|, the current contact impulses
};
// x, in: start; what is prescribed is left alone. Penalties stay in the system. iterations: of the descents before, by
// which the preconditioner ages. stats.residual: over what may be left.
linalg::SolveStats descend(const Parallel& parallel, const std::vector<Real>& f, const Target& target,
                           const std::vector<ContactRow>& rows, int iterations, VelocitySystem& system,
                           std::vector<Real>& x);

}  // namespace efsi::system
