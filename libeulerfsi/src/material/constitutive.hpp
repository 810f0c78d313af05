// Purpose: isotropic elastic laws in principal stretches behind one interface. Pure functions, no grid.
// Paper: Sec. 4.1 (corotational material of McAdams et al. 2011); stable neo-Hookean: Smith, de Goes, Kim 2018.
// Symbols: F = U S V^T with principal stretches s_i; psi energy density [J/m^3 of rest volume]; mu, lambda Lame [Pa].
#pragma once

#include "base/math_types.hpp"

namespace efsi::material {

// Values equal EFSI_MATERIAL_*.
enum class Law : std::int32_t { kCorotational = 0, kStableNeoHookean = 1, kStVenantKirchhoff = 2 };
inline constexpr Law kLaws[] = {Law::kCorotational, Law::kStableNeoHookean, Law::kStVenantKirchhoff};

struct Elastic {
  Law law = Law::kCorotational;
  double mu = 0.0;
  double lambda = 0.0;
  bool hardens = false;  // where it is pressed below kCrushed
};

// Pressed below this principal stretch a material that hardens resists more and more. The laws themselves give way to a
// pressure of 2 mu + lambda, or less, however far they are pressed, and an impact at the speed of sound is more.
inline constexpr double kCrushed = 0.4;
inline constexpr double kFlat = 0.1;  // the least that is asked for: that of an element (solid/map/credible.hpp)

// mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu)(1 - 2 nu)).
Elastic from_youngs_modulus(Law law, double youngs_modulus, double poissons_ratio);

// The elastic law of a solid whose volume the pressure keeps: lambda at most mu. A lambda of its own would do the
// pressure's work a second time, against the noise of det F; without any, cells that a soft impact crushes would resist
// too little.
Elastic beside_pressure(Elastic elastic);

// kappa/2 (J - 1)^2: of a solid whose pressure, not its law, resists a change of volume [J/m^3 of rest volume].
double bulk_energy(double kappa, double J);

// Energy, first and second derivatives. For an increment D = U^T dF V the change of stress Q = U^T dP V is
//   Q_ii = sum_j hessian(i,j) D_jj
//   Q_ij = symmetric_ij (D_ij + D_ji)/2 + skew_ij (D_ij - D_ji)/2        (i != j)
// Pair p couples the two axes other than p: 0 -> (1,2), 1 -> (2,0), 2 -> (0,1).
struct PrincipalResponse {
  double energy = 0.0;
  Vec3d stress = Vec3d::Zero();     // d psi / d s_i, principal first Piola-Kirchhoff stress [Pa]
  Mat3d hessian = Mat3d::Zero();    // d2 psi / d s_i d s_j [Pa]
  Vec3d symmetric = Vec3d::Zero();  // (P_i - P_j) / (s_i - s_j)
  Vec3d skew = Vec3d::Zero();       // (P_i + P_j) / (s_i + s_j)
};

PrincipalResponse principal_response(const Elastic& material, const Vec3d& stretch);

// The nearest positive semi-definite linearisation: negative moduli are set to zero (as McAdams et al. 2011 clamp
// theirs).
PrincipalResponse make_definite(PrincipalResponse response);

}  // namespace efsi::material
