// Purpose: the size of the next step.
// Paper: Alg. 1 line 1; Sec. 5.2 (CFL 1.8).
#pragma once

#include <cstdint>

#include "frame/scene.hpp"
#include "frame/step_limit.hpp"

namespace efsi::sim {

// Cells that a solid may have moved in a step before it is repeated smaller; a larger cfl_solid leaves its speed
// without a limit.
inline constexpr double kRetryTravel = 4.0;

// What limits a step besides the parameters (EfsiStepLimits).
struct StepLimits {
  double contact_reach = 0.0;  // distance from a wall below which the next two apply [cells]
  double contact_cfl = 0.0;    // displacement of a solid near a wall [cells]
  double contact_pace = 0.0;   // distance that shear waves travel after an impact [cells]; 0: no limit
  double flight_cfl = 0.0;     // displacement of a single solid away from walls [cells]
  double contact_share = 0.0;  // part of the solid that these waves travel where that is more
};
StepLimits step_limits(const Params& params, double lightest_density);

// time: since the start of the run. The largest step that the limits allow, at most `remaining`, and what allows no
// more; the rest up to `remaining` is divided into equal steps. solids: after find_near_folds; learn whether they keep
// energy.
StepLimit compute_time_step(const Parallel& parallel, const Scene& scene, const SolidStates& states, double fluid_speed,
                            double time, double remaining, SolidWorks& solids);

}  // namespace efsi::sim
