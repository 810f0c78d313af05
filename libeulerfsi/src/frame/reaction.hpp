// Purpose: what it takes to hold a node of a solid in a step, where a wall or a given motion prescribes its velocity.
#pragma once

#include <cstddef>
#include <functional>

#include "base/math_types.hpp"

namespace efsi::sim {

// Impulse on the node of a solid [kg m/s]; nodes are those of the common grid.
using Reaction = std::function<Vec3(std::size_t solid, std::size_t node)>;

}  // namespace efsi::sim
