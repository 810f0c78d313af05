// Purpose: what the coarse levels of the pressure know of films of fluid between solids.
// At a slip node the fluid moves along the solid by its own mass m_f alone. A coarse level has one 1/density per node,
// that of all matter, which along a film between heavy solids is up to m_s / m_f too little: its correction of a film's
// pressure overshoots by as much. In the film it takes the mean of what the cells around the node see instead.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"
#include "system/slip.hpp"

namespace efsi::system {

// Raises 1/density [m^3/kg] of free slip nodes to that of their fluid, then, where the scene has two solids, that of
// the slip nodes around the enclosed cells of fluid, which have nothing but heavy matter at their corners, to the mean
// over the cells and axes of the node.
void open_films(const Parallel& parallel, const grid::Grid& g, const SlipNodes& slip,
                std::vector<Real>& specific_volume);

}  // namespace efsi::system
