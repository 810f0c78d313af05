// Purpose: the fluid's velocity and smoke carried by the flow; what an open face lets in comes from rest.
// Paper: Alg. 1 line 22.
#pragma once

#include "fluid/advect.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "sources/jets.hpp"
#include "system/pressure_solve.hpp"

namespace efsi::sim {

// Line 22: smoke, then the velocity, which the state gets back: fluid.velocity. The flow loses what would flow in with
// a speed of its own; at slip nodes the specific volume becomes the fluid's. scratch: of the pressure system.
void advect_fluid(const StepContext& step, grid::VectorField& flow, const system::SlipNodes& slip, const Jets& jets,
                  Matter& matter, fluid::FluidState& fluid, fluid::AdvectWorkspace& work,
                  system::PressureSystem& scratch);

}  // namespace efsi::sim
