// Purpose: forces and stiffness of kBlock elements at once, one element per lane; material_force.hpp has the slow
// twins. In and out: corner a, component i of each element at row 3 a + i. Paper: Sec. 4.2; Eq. 8.
#pragma once

#include "solid/solid.hpp"

namespace efsi::solid {

// out = factor K x, one factor per element
void block_stiffness(const SolidWork& work, std::size_t block, double h, const Real* factor,
                     const Real (&x)[24][kBlock], Real* out);
// out = factor diag K
void block_stiffness_diagonal(const SolidWork& work, std::size_t block, double h, const Real* factor, Real* out);
// Of the isotropic stiffness with the traces of that of each element: lambda and mu, times its volume [J].
struct BlockModuli {
  Real lambda[kBlock], mu[kBlock];
};
BlockModuli block_moduli(const SolidWork& work, std::size_t block);
// out: forces on the corners [N]
void block_force(const SolidState& state, const SolidWork& work, std::size_t block, Real* out);

}  // namespace efsi::solid
