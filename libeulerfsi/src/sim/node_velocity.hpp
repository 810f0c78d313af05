// Purpose: the one velocity at each node of the common grid that solids and fluid have together, and the forces on it.
// Paper: Alg. 1 lines 7, 8 (f_ext); Sec. 4.2. Slip nodes keep both velocities (docs/deviations.md).
#pragma once

#include "sim/step_context.hpp"
#include "sim/workspace.hpp"

namespace efsi::sim {

// v = sum_l m_l v_l / sum_l m_l over the solids and the fluid, each with its weight less its buoyancy; at slip nodes
// the two stay apart. Takes the fluid's velocity out of the state until its advection.
void combine_velocities(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const Matter& matter, grid::VectorField& fluid_velocity, NodeVelocity& velocity);
// v += dt f_ext / m of the other forces, emitters. Emitters change smoke and temperature, too.
void add_external_forces(const StepContext& step, const Matter& matter, fluid::FluidState& fluid,
                         NodeVelocity& velocity);

}  // namespace efsi::sim
