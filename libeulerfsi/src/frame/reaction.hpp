// Purpose: impulses on nodes of solids whose velocity a wall or a prescribed motion fixes in a step.
#pragma once

#include <cstddef>
#include <functional>

#include "base/math_types.hpp"

namespace efsi::sim {

// Impulse on the node of a solid [kg m/s]; nodes are those of the common grid.
using Reaction = std::function<Vec3(std::size_t solid, std::size_t node)>;

}  // namespace efsi::sim
