// Purpose: multiplicative plasticity in principal axes: a yield stress, a flow rate, linear hardening. Pure functions.
// F = F_e F_p with det F_p = 1 (Bargteil et al. 2007; Fan et al. 2013, Sec. 3.7). Flow shrinks the deviator of the
// elastic logarithmic strain; the measure of stress is von Mises' of the Kirchhoff stress, so that the yield stress is
// that of uniaxial tension.
#pragma once

#include "material/constitutive.hpp"

namespace efsi::material {

struct Plastic {
  double yield_stress = 0.0;  // [Pa]; 0: purely elastic
  double flow_rate = 1000.0;  // at which stress above the yield stress relaxes [1/s]
  double hardening = 0.0;     // by which the yield stress grows per unit of accumulated plastic strain [Pa]

  bool yields() const { return yield_stress > 0.0; }
};

// Von Mises' equivalent of the Kirchhoff stress at these principal stretches [Pa].
double equivalent_stress(const Elastic& elastic, const Vec3d& stretch);

struct Flow {
  Vec3d strain = Vec3d::Zero();  // elastic logarithmic strain after it; its sum is that before
  double accumulated = 0.0;      // equivalent plastic strain that it adds, >= 0
};

// Flow in the time dt [s] at fixed total strain. stretch: principal elastic stretches, > 0; accumulated: equivalent
// plastic strain so far. What stress is above the yield stress would go with the strain D, and goes with
// D (1 - exp(-flow_rate dt)): as a straight line in the strain, so that two steps do what one of twice the size does.
Flow plastic_flow(const Elastic& elastic, const Plastic& plastic, const Vec3d& stretch, double accumulated, double dt);

}  // namespace efsi::material
