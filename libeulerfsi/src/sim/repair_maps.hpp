// Purpose: broken cells of the solids are repaired after the transport (solid/repair.hpp).
#pragma once

#include "sim/step_context.hpp"

namespace efsi::sim {

// Reads the masses of the transported solids, and computes them anew where cells were broken; counts these in
// StepInfo::repairs, which tells already what there was before.
void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids);

}  // namespace efsi::sim
