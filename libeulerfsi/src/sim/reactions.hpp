// Purpose: impulses on nodes of solids whose velocity a wall or a prescribed motion fixes in a step.
#pragma once

#include <functional>

#include "sim/workspace.hpp"

namespace efsi::sim {

// Impulse on the node of a solid [kg m/s]; nodes are those of the common grid.
using Reaction = std::function<Vec3(std::size_t solid, std::size_t node)>;

// After the velocity solve: G v* - f*.
Reaction velocity_reaction(const Parallel& parallel, VelocityEquation& elasticity);
// After the projection: J^T q of all the step (q: ghosts filled), minus the response of elasticity and contact.
Reaction pressure_reaction(const Parallel& parallel, const grid::Grid& grid, const PressureEquation& pressure,
                           const system::SlipNodes& slip, VelocityEquation& elasticity);

}  // namespace efsi::sim
