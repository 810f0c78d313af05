// Purpose: what held the nodes of solids in the solves of a step (frame/reaction.hpp).
#pragma once

#include "frame/reaction.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// After the velocity solve: G v* - f*. sums: of all nodes of each solid, where the solve's tolerance leaves something
// at those that nothing holds.
Reaction velocity_reaction(const Parallel& parallel, VelocityEquation& elasticity, std::vector<Vec3d>& sums);
// After the projection: J^T q of all the step (q: ghosts filled), minus the response of elasticity and contact.
Reaction pressure_reaction(const Parallel& parallel, const grid::Grid& grid, const PressureEquation& pressure,
                           const system::SlipNodes& slip, VelocityEquation& elasticity);

}  // namespace efsi::sim
