// Purpose: the trilinear hexahedral element: shape-function gradients at quadrature points, hourglass modes.
// Paper: Sec. 4.2 (8-point quadrature); one-point quadrature with hourglass stiffness as in McAdams et al. 2011.
#pragma once

#include <array>

#include "base/math_types.hpp"
#include "grid/grid.hpp"

namespace efsi::solid {

// h grad N_a at one quadrature point, a = 0..7 (corners as grid::kCorner).
using ShapeGradients = std::array<Vec3d, 8>;

// Local coordinates of an element: 0 at its centre, -1 and 1 on its faces.
// Of the 2x2x2 Gauss points, or the only one, which is `middle`.
Vec3d quadrature_point(int q, int points, const Vec3d& middle);
ShapeGradients gradients_at(const Vec3d& local);
const ShapeGradients& center_gradients();

// du_i/dx_j from the 8 corner values.
inline Mat3d displacement_gradient(const Vec3d u[8], const ShapeGradients& gradients, double h) {
  Mat3d gradient = Mat3d::Zero();
  for (std::size_t a = 0; a < 8; ++a) gradient += u[a] * gradients[a].transpose();
  return gradient / h;
}

// The four hourglass modes (orthonormal, orthogonal to all linear fields): mode m at corner a.
inline constexpr int kHourglassSign[4][8] = {{1, -1, -1, 1, 1, -1, -1, 1},
                                             {1, -1, 1, -1, -1, 1, -1, 1},
                                             {1, 1, -1, -1, -1, -1, 1, 1},
                                             {-1, 1, 1, -1, 1, -1, -1, 1}};
inline constexpr double kHourglassNorm = 0.35355339059327373;  // 1/sqrt(8)
// Stiffness of a mode is this times mu h; full integration gives 1/3 for the Laplacian, 0.33 to 0.58 for elasticity
// with lambda = mu / 2.
inline constexpr double kHourglassFactor = 0.5;

}  // namespace efsi::solid
