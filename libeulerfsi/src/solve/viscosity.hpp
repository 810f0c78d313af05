// Purpose: viscosity of the fluid in a step (fluid/viscosity.hpp): on the one velocity that fluid and solids have at
// their nodes, with the mass of both and what else Eq. 8 has of the solids, so that it drags them as a whole.
#pragma once

#include "fluid/viscosity.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// Of a viscous fluid, after Eq. 8 is set up, which gets the impulse on its unknowns and starts at the response. before:
// the velocity before the forces of the step. What walls, pins and colliders prescribe stays.
void diffuse_velocity(const StepContext& step, const Matter& matter, NodeVelocity& before, VelocityEquation& elasticity,
                      NodeVelocity& velocity, fluid::ViscousWorkspace& work);

}  // namespace efsi::sim
