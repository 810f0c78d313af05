// Purpose: what is solid of cells that are no elements, in the stiffness of the elements beside them.
// Source: aggregation of cut cells, as in unfitted finite elements (Badia, Verdugo, Martin 2018); not in the paper.
#pragma once

#include "solid/solid.hpp"

namespace efsi::solid {

// Reads fraction, volume_ratio, element and element_cell; adds to element_factor, unless that is empty. What a cell
// without an element holds of the rest volume, fraction / volume_ratio, goes in equal parts to the elements over its
// faces; where there are none to those over its edges, otherwise over its corners, otherwise to none.
void stiffen_beside_cuts(const grid::Grid& g, SolidWork& work);

}  // namespace efsi::solid
