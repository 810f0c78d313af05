// Purpose: the deformation gradient from the displacement field, and the one policy for degenerate F.
// Paper: Eq. 1, Sec. 3:  F = (I - du/dx)^-1.
#pragma once

#include "base/math_types.hpp"

namespace efsi::solid {

// Principal stretches s (of F = U S V^T), their axes in the world U, and det F.
struct Deformation {
  Vec3d stretch;
  Mat3d axes;
  double det = 1.0;
  bool degenerate = false;  // inverted, clamped to kElementStretch, or beyond kPlausibleStretch and kFlatGrowth
};

// displacement_gradient: du_i/dx_j. Eq. 1 through the eigenvectors of (I - du/dx)^T (I - du/dx) = (F F^T)^-1.
Deformation deformation_from_displacement(const Mat3d& displacement_gradient);
// Of the elastic part F_e = F F_p^-1, det F_p = 1: (F_e F_e^T)^-1 = F^-T C_p F^-1. plastic_metric: C_p = F_p^T F_p.
Deformation elastic_deformation(const Mat3d& displacement_gradient, const Mat3d& plastic_metric);

}  // namespace efsi::solid
