// Purpose: points that follow a solid without acting on it: eyes, hats, render meshes. They follow from the
// solid's map and surface alone, and so have no state.
//   A point at rest at X is reached from the vertex nearest to it at rest, Y: x(Y) + the integral of F over the line
//   from Y to X, corrected by Newton's method where the map holds data and with the last F beyond it.
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

struct Passenger {
  std::vector<Vec3d> points;         // at rest [m]
  std::vector<std::int32_t> anchor;  // per point the vertex of the solid's surface that is nearest at rest
};

// Cells between the surface and the points farthest from it: what the solid's band holds around it.
inline constexpr int kPassengerReach = kBandMargin;

// Throws Error(kArgument) where a point is not finite, or farther out of the solid than kPassengerReach cells of size
// h.
Passenger make_passenger(const Parallel& parallel, const SolidRest& rest, double h, std::vector<Vec3d> points);

// Where they are now and how fast; both are resized.
void carry(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const Passenger& passenger,
           std::vector<Vec3d>& points, std::vector<Vec3d>& velocities);

}  // namespace efsi::solid
