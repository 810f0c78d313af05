// Purpose: the scene's forces (frame/force_field.hpp) in a step.
// They change the velocities of solids and fluid, each by itself, before these become one (Alg. 1 line 7; f_ext of
// Eq. 8): what acts on a solid does not act on the fluid at shared nodes.
#pragma once

#include "frame/step_context.hpp"

namespace efsi::sim {

// Adds the forces that act in the step, as long as they do, to the velocities of the solids' nodes that have mass and
// to the fluid's. SolidWork.force_velocity: what they add to solids. Returns the number of nodes visited.
std::uint64_t apply_forces(const StepContext& step, const grid::Grid& common, SolidWorks& solids, SolidStates& states,
                           grid::VectorField& fluid_velocity);

}  // namespace efsi::sim
