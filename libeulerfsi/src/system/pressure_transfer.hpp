// Purpose: transfers between two levels of the pressure multigrid: residuals down, corrections up, and 1/density.
#pragma once

#include <vector>

#include "system/divergence.hpp"

namespace efsi::system {

// b = R r, the transpose of the trilinear prolongation. Padded cells; b = 0 where the coarse grid has no equation.
void restrict_residual(const Parallel& parallel, const PressureGrid& fine, const std::vector<Real>& r,
                       const PressureGrid& coarse, std::vector<Real>& b);
// x += P xc, trilinear, where the fine grid has equations.
void prolong_and_add(const Parallel& parallel, const PressureGrid& coarse, const std::vector<Real>& xc,
                     const PressureGrid& fine, std::vector<Real>& x);
// c = (1/2, 1, 1/2)^3 / 8 average of f at the nodes around every second node.
void coarsen_specific_volume(const Parallel& parallel, const Grid& fine, const std::vector<Real>& f, const Grid& coarse,
                             std::vector<Real>& c);

}  // namespace efsi::system
