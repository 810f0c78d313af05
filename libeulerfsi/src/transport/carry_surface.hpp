// Purpose: the embedded surface moves with its solid; what that says of the solid's volume and whether it is whole.
// Paper: Sec. 4.6.
#pragma once

#include "frame/step_context.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::sim {

// Solid l, after its advection in this frame, which has left `packed`: state.surface, state.leak, state.whole.
void carry_surface(const StepContext& step, std::size_t l, const solid::BodyStep& frame,
                   const solid::AdvectWorkspace& packed, const solid::SolidWork& work, solid::SolidState& state);

}  // namespace efsi::sim
