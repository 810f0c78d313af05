// Purpose: the semi-implicit velocity of the solids: G and f* of this step, and the solve.
// Paper: Alg. 1 lines 8, 9; Sec. 4.4. The equation's home is system/velocity_system.hpp.
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// Line 8: G on the nodes that carry solids, and what holds them.
void assemble_velocity_system(const StepContext& step, SolidStates& states, SolidWorks& solids, const Matter& matter,
                              NodeVelocity& velocity, VelocityEquation& elasticity);
// Line 8: f*; v_star: the velocity before the solve.
void set_right_side(const StepContext& step, SolidStates& states, const SolidWorks& solids, const grid::Grid& common,
                    NodeVelocity& velocity, VelocityEquation& elasticity);
// Line 9.
void solve_velocity(const StepContext& step, VelocityEquation& elasticity, NodeVelocity& velocity);
// The velocity of the solids becomes x, that of the fluid beside them follows along the normals of slip nodes.
void write_back(const Parallel& parallel, const system::VelocitySystem& system, const std::vector<Real>& x,
                NodeVelocity& velocity);

}  // namespace efsi::sim
