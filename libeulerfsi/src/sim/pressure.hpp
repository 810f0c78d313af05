// Purpose: the lines of Algorithm 1 that make the velocity of solids and fluid free of divergence, and the coupling
// step between elasticity and pressure that production makes in addition. Paper: Alg. 1 lines 10, 11; Eqs. 11-13.
#pragma once

#include "sim/step.hpp"

namespace efsi::sim {

// The system of line 10. Where the last pressure nearly balances what else pushes the solids, as at rest, it acts in
// line 9 already.
void prepare_pressure(const Parallel& parallel, const Scene& scene, double dt, const State& state, Workspace& work,
                      Profile& profile);
// Line 10, Eq. 12.
void solve_pressure(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                    Profile& profile, StepInfo& info);
// Line 11, Eq. 13, or the projection.
void project_velocity(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                      Profile& profile, StepInfo& info);

}  // namespace efsi::sim
