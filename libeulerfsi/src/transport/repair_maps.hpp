// Purpose: broken cells of the solids are repaired after the transport (solid/element/repair.hpp).
#pragma once

#include "frame/step_context.hpp"

namespace efsi::sim {

// After the transport, before anything repairs it: what there is of broken, clamped and rejected cells, and det F.
void inspect_maps(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out);

// Straight after the transport: new elements far from the volume of their neighbours (solid/element/entering.hpp).
// Reads and writes what compute_masses does.
void settle_entering(const StepContext& step, SolidStates& states, SolidWorks& solids);

// Reads the masses of the transported solids, and computes them anew where cells were broken; counts these in
// StepInfo::repairs, which tells already what there was before.
void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids);

}  // namespace efsi::sim
