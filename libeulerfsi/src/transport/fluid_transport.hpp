// Purpose: the fluid's velocity and smoke carried by the flow; what an open face lets in comes from rest.
// Paper: Alg. 1 line 22.
#pragma once

#include "fluid/advect.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/pressure_equation.hpp"

namespace efsi::sim {

// Line 22: smoke, then the velocity, which the state gets back: fluid.velocity. The flow loses what would flow in with
// a speed of its own; at slip nodes the specific volume becomes the fluid's. Of the pressure's system and of its q the
// arrays are used.
void advect_fluid(const StepContext& step, const SolidStates& states, grid::VectorField& flow,
                  const system::SlipNodes& slip, PressureEquation& pressure, Matter& matter, fluid::FluidState& fluid,
                  fluid::AdvectWorkspace& work);

}  // namespace efsi::sim
