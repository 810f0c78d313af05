// Purpose: what a particle's velocity becomes where it is nearer than h to another solid.
// Paper: Alg. 1 line 14; Eq. 14, 15; Sec. 4.6; after Bridson et al. 2002.
//   Eq. 14  r = min(dt k d, m (0.1 d / dt - v_N)), d the overlap h - phi, where v_N < 0.1 d / dt; Delta v_N = r / m
//   Eq. 15  v_T = max(1 - mu Delta v_N / |v_T|, 0) v_T
// v_N, v_T: of the particle against the other solid, v_N along the normal out of it. The paper prints -min: the sign
// that r has for the surface; on the particle it acts the other way. A particle that parts faster gets nothing.
#pragma once

#include <algorithm>

#include "base/math_types.hpp"

namespace efsi::solid {

struct Repulsion {
  double normal_impulse = 0.0;             // along the normal [N s]
  Vec3d friction_impulse = Vec3d::Zero();  // of friction [N s]
  bool sticks = false;                     // friction has taken all of v_T
};

// relative: velocity of the particle against the other solid [m/s]; normal: out of it, unit; overlap: d > 0 [m];
// k: stiffness [N/m]; mass: of the particle [kg]
inline Repulsion repel(const Vec3d& relative, const Vec3d& normal, double overlap, double mass, double k,
                       double friction, double dt) {
  Repulsion r;
  const double v_n = relative.dot(normal), parting = 0.1 * overlap / dt;
  if (!(overlap > 0.0) || !(v_n < parting)) return r;
  r.normal_impulse = std::min(dt * k * overlap, mass * (parting - v_n));
  const Vec3d v_t = relative - v_n * normal;
  const double speed = v_t.norm();
  if (speed > 0.0 && friction > 0.0) {
    const double left = std::max(1.0 - friction * r.normal_impulse / mass / speed, 0.0);
    r.sticks = left == 0.0;
    r.friction_impulse = -mass * (1.0 - left) * v_t;
  }
  return r;
}

}  // namespace efsi::solid
