// Purpose: what it takes to hold a node of a solid in a step, where a wall or a given motion prescribes its velocity.
#pragma once

#include <functional>

#include "sim/workspace.hpp"

namespace efsi::sim {

// Impulse on the node of a solid [kg m/s]; nodes are those of the common grid.
using Reaction = std::function<Vec3(std::size_t solid, std::size_t node)>;

// After the velocity solve: G v* - f*.
Reaction velocity_reaction(const Parallel& parallel, VelocityEquation& elasticity);
// After the projection: J^T q of all the step (q: ghosts filled), less what elasticity and contact answered to it.
Reaction pressure_reaction(const Parallel& parallel, const grid::Grid& grid, const PressureEquation& pressure,
                           const system::SlipNodes& slip, VelocityEquation& elasticity);

}  // namespace efsi::sim
