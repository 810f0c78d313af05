// Purpose: how fast surfaces that meet may close their gap, and how fast overlap is removed: one rule for
// walls, solids and the cells of a solid.
#pragma once

#include <algorithm>

#include "frame/step_context.hpp"

namespace efsi::sim {

inline constexpr double kOverlapTime = 1.0 / 24.0;  // s: time in which overlap is removed; at least four steps

// What is deeper than that [cells] is removed in so many steps: the map loses a dimple of one to two cells, and the
// overlap grows by a tenth of a cell in a step, while what rows ask for holds. Steps as they were planned: one that is
// repeated, since its motion was too fast, asks for no faster one.
inline constexpr double kShallow = 0.5, kDeepSteps = 2.0;
inline constexpr double kDeepest = 1.0;  // cells: bound of the overlap

inline double overlap_time(double dt) { return std::max(kOverlapTime, 4.0 * dt); }

// The least speed at which a gap has to open [m/s]: it may just close in the step; where it is < 0 the overlap is
// removed.
inline double least_velocity(double gap, const StepContext& step) {
  const double h = step.scene.grid.h;
  if (gap > 0.0) return -gap / step.dt;
  const double overlap = std::min(-gap, kDeepest * h), shallow = std::min(overlap, kShallow * h);
  return shallow / overlap_time(step.dt) + (overlap - shallow) / (kDeepSteps * step.planned_dt);
}

}  // namespace efsi::sim
