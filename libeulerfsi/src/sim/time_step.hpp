// Purpose: the size of the next step.
// Paper: Alg. 1 line 1; Sec. 5.2 (CFL 1.8).
#pragma once

#include <cstdint>

#include "frame/scene.hpp"

namespace efsi::sim {

// Cells that a solid may have moved in a step before it is repeated smaller; a larger cfl_solid leaves its speed
// without a limit.
inline constexpr double kRetryTravel = 4.0;

// steps: made so far. The largest step that the limits allow, at most `remaining`; the rest up to `remaining` is
// divided into equal steps. solids: after find_near_folds.
double compute_time_step(const Parallel& parallel, const Scene& scene, const SolidStates& states, double fluid_speed,
                         std::uint64_t steps, double remaining, const SolidWorks& solids);

}  // namespace efsi::sim
