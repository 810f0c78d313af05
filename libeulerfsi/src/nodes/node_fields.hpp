// Purpose: what matter is where on the common grid, and the velocity that it has together.
#pragma once

#include <cstdint>
#include <vector>

#include "frame/window.hpp"
#include "system/slip.hpp"

namespace efsi::sim {

// The common grid of the stages that join solids and fluid, and what matter is where on it. Made of the solids' places.
struct Matter {
  CommonGrid common;
  std::vector<std::uint8_t> fixed;    // per node: bit a: component a is fixed by a wall
  std::vector<Real> fluid_mass;       // per node, where solids leave room [kg]; empty without solids
  std::vector<Real> mass;             // of all matter per node [kg]; empty without solids
  std::vector<Real> specific_volume;  // 1/density per node [m^3/kg]
  std::vector<std::uint8_t> owned;    // padded cells: 1 + the solid whose stiffness they carry, 0; empty without solids
  std::vector<Real> cell_fraction;    // part of each cell that solids fill; empty without solids
};

// The velocity of Eq. 11.
struct NodeVelocity {
  grid::VectorField field;  // at the nodes of the common grid, at slip nodes the fluid's [m/s]
  system::SlipNodes slip;   // nodes where the fluid slips along a solid, with the solid's velocity there
};

}  // namespace efsi::sim
