// Purpose: one step of Algorithm 1, one call per line.
// Paper: Alg. 1.
#pragma once

#include "base/parallel.hpp"
#include "frame/profile.hpp"
#include "frame/scene.hpp"
#include "frame/step_info.hpp"
#include "sim/workspace.hpp"

namespace efsi::sim {

// Advances `state` by one step of at most `remaining` seconds, smaller by `shrink` than the limits allow.
StepInfo step(const Parallel& parallel, const Scene& scene, double remaining, double shrink, State& state,
              Workspace& work, Profile& profile);

}  // namespace efsi::sim
