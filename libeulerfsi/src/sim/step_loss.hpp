// Purpose: what a step takes of the energy of a solid in contact, where its stiffness is implicit, and how long it
// should have been for that.
#pragma once

#include "frame/step_context.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::sim {

inline constexpr double kContactPace = 0.7;          // cells that a shear wave passes in a step in contact, or
inline constexpr double kContactShare = 1.0 / 24.0;  // this part of the solid, the cubic root of its volume, if more
inline constexpr double kNormalTolerance = 0.15;     // the tolerance for which these two are meant

// Shear waves in a solid: the time in which one passes it, and the longest step that resolves them [s].
struct ShearWaves {
  double pass, resolved;
};
ShearWaves shear_waves(const Scene& scene, const solid::SolidRest& rest);

// v.K v of a solid [J/s^2]: its implicit stiffness takes up to dt^2 of it in a step of dt in which v strains its map.
double v_k_v(const solid::CellMotion& motion);
// Its kinetic energy and that of a fall that need not be kept [J].
double moving_energy(const Scene& scene, const solid::SolidRest& rest, const solid::CellMotion& motion);

// Line 13: the motion by which the step strains the maps of solids near what they may touch, SolidWork::straining.
void measure_straining(const StepContext& step, const SolidStates& states, SolidWorks& solids);

// After a step of dt: whether it does not resolve the shear waves of a solid and has taken more than twice
// step_tolerance of that solid's energy: an impact that it did not resolve. Sets SolidState::by_loss, before the step
// for its repetition and after it for the next one: by which it takes step_tolerance while a wave passes the solid.
// solids: with their elements at the end of the step.
bool keep_energy(const Parallel& parallel, const Scene& scene, double dt, const SolidWorks& solids, SolidStates& before,
                 SolidStates& after);

}  // namespace efsi::sim
