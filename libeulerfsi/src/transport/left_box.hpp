// Purpose: solids that have left the box through open faces: no element is left, and they take no further part.
#pragma once

#include "frame/step_context.hpp"

namespace efsi::sim {

// After compute_masses: of a solid that is not whole and has no element nothing stays but its surface and its velocity,
// the mean of what its nodes hold (solid::has_left).
void remove_departed(const StepContext& step, SolidStates& states, SolidWorks& solids);

// The surface of such a solid goes straight on.
void continue_motion(double dt, solid::SolidState& state);

}  // namespace efsi::sim
