// Purpose: where a material point is: the inverse of the map X = x - u(x), point by point.
#pragma once

#include <array>

#include "solid/solid.hpp"

namespace efsi::solid {

// The lowest node of the cell that x lies in, or of the nearest one, and where in the cell x lies.
std::size_t lower_node(const Grid& g, const Vec3d& x, double f[3]);
// Trilinear value and gradient of u in double precision; false where a corner holds no data. corner: the corners of a
// cell of the band (grid::corner_offsets).
bool sample_displacement(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& x, Vec3d& u,
                         Mat3d& gradient);
// Newton's method for x - u(x) = X from x on, which becomes the best iterate; returns the residual there [m].
double correct_point(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& material,
                     Vec3d& best_x);
constexpr double kHeldResidual = 0.1;  // cells of material: a place with more residual does not hold the point

}  // namespace efsi::solid
