// Purpose: Coulomb's law of a face of the box and a solid as a whole, by the normal impulse of this step. In the
// velocity solve friction is limited by that of the last one, since the pressure has its part in this one's: while a
// contact unloads it is too large, in its first step it is missing (docs/numerics/wall-friction.md).
#pragma once

#include <vector>

#include "contact/wall_row.hpp"
#include "frame/scene.hpp"
#include "nodes/node_fields.hpp"
#include "solid/momentum.hpp"

namespace efsi::sim {

// On a body.
struct RigidImpulse {
  Vec3d linear = Vec3d::Zero();   // [kg m/s]
  Vec3d angular = Vec3d::Zero();  // about its centre of mass [kg m^2/s]

  // arm: from the centre of mass to where the impulse acts.
  void add(const Vec3d& arm, const Vec3d& impulse) {
    linear += impulse;
    angular += arm.cross(impulse);
  }
};

// What friction at walls lacks in the step, or has too much, per solid; empty where there is none. velocity: after the
// pressure; momenta: of the solids with it.
std::vector<RigidImpulse> missing_friction(const Scene& scene, const std::vector<WallRow>& rows,
                                           const NodeVelocity& velocity, const grid::Grid& common,
                                           const std::vector<solid::Momenta>& momenta);

}  // namespace efsi::sim
