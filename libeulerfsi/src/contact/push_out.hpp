// Purpose: how fast surfaces that meet may close their gap, and how fast what is too deep comes back: one rule for
// walls, solids and the cells of a solid.
#pragma once

#include <algorithm>

namespace efsi::sim {

inline constexpr double kPushOut = 1.0 / 24.0;  // s: in which what is too deep is given back; at least four steps

inline constexpr double kDeepest = 1.0;  // cells: deeper than that counts as that

inline double push_out_time(double dt) { return std::max(kPushOut, 4.0 * dt); }

// The least speed at which a gap has to open [m/s]: it may just close in the step; where it is < 0 it is given back.
inline double least_velocity(double gap, double h, double dt) {
  return -std::max(gap, -kDeepest * h) / (gap > 0.0 ? dt : push_out_time(dt));
}

}  // namespace efsi::sim
