// Purpose: the map of cells that become elements where it is extrapolated (docs/numerics/credible-cells.md).
// Beside a notch or a dent the extension, a fit to all data around, is that of neither side: what enters with it brings
// strain that nothing has done work for.
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// A new element that is strained against the better known elements beside it beyond kEnteringStretch takes their map at
// those of its corners that are not known. Beside it: over its faces, where there are none over its edges, otherwise
// over its corners; each counts by its known corners. Reads what compute_mass has made of state; where it returns true
// it has changed state.u and called compute_mass anew. Not where cells are stiff as a whole (`paper2016`), nor where
// no choice of elements is remembered.
bool settle_entering(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work);

}  // namespace efsi::solid
