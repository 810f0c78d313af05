// Purpose: the part of a unit cube that lies on the inner side of a plane, exactly, and its centroid.
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
  // What of the cube is below the plane grows as a cube of a, then as a square, then as a line; the differences are
  // written out, so that nothing cancels where the plane is nearly along an axis.
  double volume;
  const auto square = [&] { return (3.0 * a * (a - m[0]) + m[0] * m[0]) / (6.0 * m[1] * m[2]); };
  const auto corner = [&](double t) { return t > 0.0 ? t * (t / m[0]) * (t / m[1]) / (6.0 * m[2]) : 0.0; };
  if (a < m[0])
    volume = corner(a);
  else if (a < m[1])
    volume = square();
  else if (a < m[0] + m[1])
    volume = square() - corner(a - m[1]) - corner(a - m[2]);
  else
    volume = (2.0 * a - m[0] - m[1]) / (2.0 * m[2]);
  volume = std::clamp(volume, 0.0, 1.0);
  return alpha <= 0.5 * sum ? volume : 1.0 - volume;
}

// The centroid of that part, from the cube's centre, in units of the edge; exact to 1e-2. An empty part has that of a
// vanishing one.
inline Vec3d plane_cut_centroid(double distance, const Vec3d& normal) {
  Eigen::Index along;
  const double steepest = normal.cwiseAbs().maxCoeff(&along);
  if (!(steepest > 0.0)) return Vec3d::Zero();
  constexpr int kSamples = 6;  // columns along the steepest axis, per axis across
  const Eigen::Index first = (along + 1) % 3, second = (along + 2) % 3;
  const double side = normal[along] > 0.0 ? -1.0 : 1.0;  // of the inner end of a column
  double volume = 1e-12;
  Vec3d moment = Vec3d::Zero();
  for (int i = 0; i < kSamples; ++i)
    for (int j = 0; j < kSamples; ++j) {
      Vec3d place;
      place[first] = (i + 0.5) / kSamples - 0.5;
      place[second] = (j + 0.5) / kSamples - 0.5;
      const double away = distance + normal[first] * place[first] + normal[second] * place[second];
      const double height = std::clamp(0.5 - away / steepest, 0.0, 1.0);
      place[along] = side * 0.5 * (1.0 - height);
      volume += height;
      moment += height * place;
    }
  return moment / volume;
}

}  // namespace efsi::grid
