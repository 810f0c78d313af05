// Purpose: what survives a step: what a checkpoint holds and the state hash covers.
#pragma once

#include <cstdint>
#include <vector>

#include "fluid/fluid.hpp"
#include "sim/window.hpp"

namespace efsi::sim {

struct State {
  double time = 0.0;  // [s]
  std::uint64_t steps = 0;
  double fluid_speed = 0.0;  // largest component [m/s]; for the next time step
  fluid::FluidState fluid;
  Window window;  // on which its pressure is known, 0 elsewhere
  std::vector<solid::SolidState> solids;
};

}  // namespace efsi::sim
