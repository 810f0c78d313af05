// Purpose: the one velocity at each node of the common grid that solids and fluid have together.
// Paper: Alg. 1 line 7; Sec. 4.2. Slip nodes keep both velocities (docs/deviations.md).
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// v = sum_l m_l v_l / sum_l m_l over the solids and the fluid, each with its weight less its buoyancy; at slip nodes
// the two stay apart. Takes the fluid's velocity out of the state until its advection.
void combine_velocities(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const Matter& matter, grid::VectorField& fluid_velocity, NodeVelocity& velocity);
// The same without weight, with a copy of the fluid's.
void copy_velocities(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     const grid::VectorField& fluid_velocity, const system::SlipNodes& slip, NodeVelocity& copy);

}  // namespace efsi::sim
