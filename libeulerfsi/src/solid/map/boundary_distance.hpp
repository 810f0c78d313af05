// Purpose: how far the boundary of a deformed solid is.
#pragma once

#include "solid/solid.hpp"

namespace efsi::solid {

// How far x is outside the boundary (inside: < 0) along the unit vector `outwards` [m]. length: of the gradient of the
// distance at rest at x, seen where the material is now, bounded by what a map that is extrapolated in part can be
// believed. The distance at rest over `length` is an estimate. Where it leads beyond the boundary (the solid is crushed
// by more than the bound) the place between at which the distance at rest vanishes is found by regula falsi (Illinois);
// elsewhere, and where the map is not known at its end, it is the result.
double boundary_distance(const SolidRest& rest, const SolidState& state, const Vec3d& x, const Vec3d& outwards,
                         double length);

}  // namespace efsi::solid
