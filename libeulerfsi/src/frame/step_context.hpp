// Purpose: what every stage of a step is given beside the fields that it names: the scene, the step's time and size,
// and where it reports.
#pragma once

#include "base/parallel.hpp"
#include "frame/profile.hpp"
#include "frame/scene.hpp"
#include "frame/step_info.hpp"

namespace efsi::sim {

struct StepContext {
  const Parallel& parallel;
  const Scene& scene;
  double time, dt;    // at the start of the step, of the step [s]
  double planned_dt;  // what the limits allow [s]; longer than dt where the step is repeated
  Profile& profile;
  StepInfo& info;
};

}  // namespace efsi::sim
