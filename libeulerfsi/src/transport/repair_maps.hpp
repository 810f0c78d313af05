// Purpose: broken cells of the solids are put back in shape after the transport (solid/element/repair.hpp).
#pragma once

#include "frame/step_context.hpp"

namespace efsi::sim {

// Reads the masses of the transported solids, and computes them anew where cells were broken; counts these in
// StepInfo::repairs, which tells already what there was before.
void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids);

}  // namespace efsi::sim
