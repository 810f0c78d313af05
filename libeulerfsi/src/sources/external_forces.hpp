// Purpose: what emitters, smoke, heat and vorticity confinement add to the velocity in a step.
// Paper: Alg. 1 line 8 (f_ext).
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// v += dt f_ext / m of the other forces, emitters. Emitters change smoke and temperature, too.
void add_external_forces(const StepContext& step, const Matter& matter, fluid::FluidState& fluid,
                         NodeVelocity& velocity);

}  // namespace efsi::sim
