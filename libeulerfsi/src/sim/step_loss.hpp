// Purpose: what a step takes of the energy of a solid where its stiffness is implicit, and how long it should have been
// for that.
#pragma once

#include "frame/step_context.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::sim {

inline constexpr double kContactPace = 0.7;          // cells that a shear wave passes in a step in contact, or
inline constexpr double kContactShare = 1.0 / 24.0;  // this part of the solid, the cubic root of its volume, if more
inline constexpr double kNormalTolerance = 0.15;     // the tolerance for which these two are meant

// A step that resolves the shear waves of a solid, of which nothing is asked [s].
double resolved_step(const Scene& scene, const solid::SolidRest& rest);
// The longest one by what the solid may lose in it, as the last one tells, or the velocity that it begins with [s].
double longest_step(const Parallel& parallel, const Scene& scene, const solid::SolidRest& rest,
                    const solid::SolidState& solid, bool touches);

// Line 13: the motion by which the step strains the maps of solids whose energy it must keep, SolidWork::straining.
void measure_straining(const StepContext& step, const SolidStates& states, SolidWorks& solids);

// After a step of dt: whether it has taken too much of the energy of a solid, whose shear waves it does not resolve: an
// impact. Sets SolidState::by_loss, before the step for its repetition and after it for the next one. solids: with
// their elements at the end of the step.
bool keep_energy(const Parallel& parallel, const Scene& scene, double dt, const SolidWorks& solids, SolidStates& before,
                 SolidStates& after);

}  // namespace efsi::sim
