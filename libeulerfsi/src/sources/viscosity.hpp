// Purpose: viscosity of the fluid in a step (fluid/viscosity.hpp): on the one velocity that fluid and solids have at
// their nodes, with the mass of both, so that it drags solids along. Before Eq. 8, in which elasticity responds.
#pragma once

#include "fluid/viscosity.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// Of a viscous fluid. What walls, pins and colliders prescribe stays.
void diffuse_velocity(const StepContext& step, const Matter& matter, NodeVelocity& velocity,
                      fluid::ViscousWorkspace& work);

}  // namespace efsi::sim
