// Purpose: a node at which a pin or a collider gives the velocity (given/prescribed.hpp).
#pragma once

#include "base/math_types.hpp"

namespace efsi::sim {

// A node of a solid whose velocity is given.
struct PrescribedNode {
  std::size_t pin = 0, solid = 0, node = 0;  // node: of the common grid
  Vec3 velocity = Vec3::Zero();
  Vec3d impulse = Vec3d::Zero();  // reaction in this step [kg m/s]
};

}  // namespace efsi::sim
