// Purpose: the size of the next step.
// Paper: Alg. 1 line 1; Sec. 5.2 (CFL 1.8).
#pragma once

#include <cstdint>

#include "sim/scene.hpp"

namespace efsi::sim {

// steps: made so far. The largest step that the limits allow, at most `remaining`; the rest up to `remaining` is
// divided into equal steps. Of solids: the fold points that are near each other.
double compute_time_step(const Parallel& parallel, const Scene& scene, const SolidStates& states, double fluid_speed,
                         std::uint64_t steps, double remaining, SolidWorks& solids);

}  // namespace efsi::sim
