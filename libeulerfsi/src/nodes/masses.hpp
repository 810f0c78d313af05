// Purpose: what matter is where on the common grid.
// Paper: Alg. 1 lines 3, 7; Sec. 4.2.
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// Line 3: mass of each solid at the nodes of its band, and which cells carry its stiffness.
void compute_masses(const StepContext& step, const SolidStates& states, SolidWorks& solids);
// Line 7: where the solids' masses leave the common grid, and window and pressure with it; what the fluid weighs where
// they leave room and what all matter weighs, part of the cells that is solid; components that walls fix, nodes along
// which the fluid slips.
void combine_masses(const StepContext& step, const SolidStates& states, const SolidWorks& solids, Window& window,
                    std::vector<Real>& pressure, Matter& matter, system::SlipNodes& slip);

}  // namespace efsi::sim
