// Purpose: the stiffness of kBlock elements at once, one element per lane; element_stiffness is its slow twin.
// Paper: Sec. 4.2; Eq. 8.
#pragma once

#include "solid/solid.hpp"

namespace efsi::solid {

// out = factor K x for one block; x, out: corner a, component i of each element at row 3 a + i.
void block_stiffness(const SolidWork& work, std::size_t block, double h, Real factor, const Real (&x)[24][kBlock],
                     Real* out);

}  // namespace efsi::solid
