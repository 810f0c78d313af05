// Purpose: internal force and stiffness of a solid's elements, matrix-free.
// Paper: Alg. 1 line 4; Sec. 4.4, Eq. 7, 9, 10 (K at fixed x: the nodes move fictitiously with the material).
//   f_a = -tau grad N_a dV0,  tau = P F^T,  dV0 = det(F^-1) dV
//   (K v)_a = U T(E) U^T grad N_a,  E = U^T (sum_b v_b grad N_b^T) U
// Departs from the paper: the stiffness is made positive semi-definite per point; one-point quadrature with hourglass
// stiffness is offered beside the paper's 8 points.
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Fills work.point, det F range, degenerate count and elastic energy. points_per_element: 1 or 8.
void compute_material(const Parallel& parallel, const SolidRest& rest, const SolidState& state, int points_per_element,
                      SolidWork& work);

// Element e: out[3 a + i] = force on corner a, component i [N].
void element_force(const SolidState& state, const SolidWork& work, std::size_t e, Real out[24]);
// out = K x for the element's 24 corner values x.
void element_stiffness(const SolidWork& work, double h, std::size_t e, const Real x[24], Real out[24]);
// Diagonal of the element's K.
void element_stiffness_diagonal(const SolidWork& work, double h, std::size_t e, Real out[24]);

}  // namespace efsi::solid
