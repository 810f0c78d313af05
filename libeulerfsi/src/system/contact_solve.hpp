// Purpose: Eq. 8 with contact: the velocity of G v = f + B^T r under unilateral contact and Coulomb friction. By
// augmented Lagrangian: a descent with kappa B^T (B v - tau n) of the rows that are closed, and r takes up what that
// leaves (docs/numerics/solid-contact.md).
#pragma once

#include "system/contact_row.hpp"

namespace efsi::system {

// Solves for x, in: start, and for the impulses, in: estimates. The rows that are closed stay in G as penalties.
// Iterations are those of all descents. f: without the rows. negligible: velocities below do not count [m/s].
linalg::SolveStats solve_contact(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& f,
                                 double tolerance, double negligible, VelocitySystem& system,
                                 std::vector<ContactRow>& rows, std::vector<Real>& x);

}  // namespace efsi::system
