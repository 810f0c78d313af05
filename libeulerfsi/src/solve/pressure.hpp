// Purpose: the lines of Algorithm 1 that make the velocity of solids and fluid free of divergence, and the coupling
// step between elasticity and pressure that production makes in addition. Paper: Alg. 1 lines 10, 11; Eqs. 11-13.
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// The system of line 10. Where the last pressure, that of the state, nearly balances the other forces on the solids, as
// at rest, it acts in line 9 already: on f*, on the momentum that v* has to have and on the velocity of the fluid.
void prepare_pressure(const StepContext& step, const SolidStates& states, SolidWorks& solids, const Matter& matter,
                      const std::vector<Real>& last, VelocityEquation& elasticity, NodeVelocity& velocity,
                      PressureEquation& pressure);
// Line 10, Eq. 12: pressure.q, from the last pressure, whose array it takes until line 11, when the part that has been
// carried is in its place; before that the coupling
// step, which changes the velocity.
void solve_pressure(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                    fluid::FluidState& fluid, VelocityEquation& elasticity, NodeVelocity& velocity,
                    PressureEquation& pressure);
// Line 11, Eq. 13, or the projection; next: the pressure of the step, that of q and what has been carried.
void project_velocity(const StepContext& step, const grid::Grid& g, VelocityEquation& elasticity,
                      PressureEquation& pressure, NodeVelocity& velocity, std::vector<Real>& next);

}  // namespace efsi::sim
