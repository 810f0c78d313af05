// Purpose: how far the boundary of a deformed solid is.
#pragma once

#include "solid/map/credible.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// The boundary as it is seen from a place, to first order.
struct SeenBoundary {
  double length;    // of the gradient of the distance at rest, seen where the material is now, as far as it is believed
  double distance;  // to the boundary, < 0 inside; in the unit of that at rest
  Vec3d outwards;   // unit vector; zero where the gradient is
};
// rest_distance: of the material there; gradient: F^-T of that distance's.
inline SeenBoundary see_boundary(double rest_distance, const Vec3d& gradient, const StretchBounds& believed) {
  const double norm = gradient.norm(), length = believed.clamp(norm);
  return {length, rest_distance / length, norm > 1e-12 ? Vec3d(gradient / norm) : Vec3d::Zero()};
}

// How far x is outside the boundary (inside: < 0) along the unit vector `outwards` [m]. length: SeenBoundary's. The
// distance at rest over it is an estimate. Where it leads beyond the boundary (the solid is crushed
// by more than the bound) the place between at which the distance at rest vanishes is found by regula falsi (Illinois);
// elsewhere, and where the map is not known at its end, it is the result.
double boundary_distance(const SolidRest& rest, const SolidState& state, const Vec3d& x, const Vec3d& outwards,
                         double length);

}  // namespace efsi::solid
