// Purpose: the part of a unit cube that lies on the inner side of a plane, exactly.
// Reference: Scardovelli, Zaleski 2000 (closed forms for a plane cutting a cell).
#pragma once

#include <algorithm>
#include <cmath>

#include "base/math_types.hpp"

namespace efsi::grid {

// distance: signed distance of the cube's centre to the plane in units of the edge, negative inside; normal: unit
// vector to the outside. Returns the volume of { x in cube : normal . x + distance < 0 } in [0, 1].
inline double plane_cut_fraction(double distance, const Vec3d& normal) {
  double m[3] = {std::abs(normal[0]), std::abs(normal[1]), std::abs(normal[2])};
  std::sort(m, m + 3);
  const double sum = m[0] + m[1] + m[2];
  if (!(sum > 0.0)) return distance < 0.0 ? 1.0 : 0.0;
  // Height of the plane above the inner corner, 0..sum; symmetric about the half.
  const double alpha = 0.5 * sum - distance;
  if (alpha <= 0.0) return 0.0;
  if (alpha >= sum) return 1.0;
  const double a = std::min(alpha, sum - alpha);
  double volume;
  const double tiny = 1e-9 * sum;
  if (m[0] < tiny && m[1] < tiny) {
    volume = a / m[2];
  } else if (m[0] < tiny) {  // a line cutting a square
    const auto positive2 = [](double t) { return t > 0.0 ? t * t : 0.0; };
    volume = (a * a - positive2(a - m[1]) - positive2(a - m[2])) / (2.0 * m[1] * m[2]);
  } else {
    const auto positive3 = [](double t) { return t > 0.0 ? t * t * t : 0.0; };
    volume = (a * a * a - positive3(a - m[0]) - positive3(a - m[1]) - positive3(a - m[2]) + positive3(a - m[0] - m[1]) +
              positive3(a - m[0] - m[2]) + positive3(a - m[1] - m[2])) /
             (6.0 * m[0] * m[1] * m[2]);
  }
  volume = std::clamp(volume, 0.0, 1.0);
  return alpha <= 0.5 * sum ? volume : 1.0 - volume;
}

}  // namespace efsi::grid
