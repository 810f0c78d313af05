// Purpose: how fast surfaces that meet may close their gap, and how fast overlap is removed: one rule for
// walls, solids and the cells of a solid.
#pragma once

#include <algorithm>

namespace efsi::sim {

inline constexpr double kOverlapTime = 1.0 / 24.0;  // s: time in which overlap is removed; at least four steps

inline constexpr double kDeepest = 1.0;  // cells: bound of the overlap

inline double overlap_time(double dt) { return std::max(kOverlapTime, 4.0 * dt); }

// The least speed at which a gap has to open [m/s]: it may just close in the step; where it is < 0 the overlap is
// removed.
inline double least_velocity(double gap, double h, double dt) {
  return -std::max(gap, -kDeepest * h) / (gap > 0.0 ? dt : overlap_time(dt));
}

}  // namespace efsi::sim
