// Purpose: linear and angular momentum of a body, and their restoration.
// Transport exerts no force and internal forces sum to nothing, so both must leave a free body's linear and angular
// momentum as they were; on a grid they do not: tracing back a spin of w gives cos(w dt) of it, the nodes' masses
// change as the solid moves over them, a solve ends at its tolerance. The deficit is returned as the rigid motion
// that changes the velocity least in the norm of the mass. Departs from the paper: it does neither
// (docs/deviations.md).
#pragma once

#include <span>

#include "base/parallel.hpp"
#include "solid/affine_flow.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

struct Momenta {
  double mass = 0.0;              // [kg]
  Vec3d center = Vec3d::Zero();   // of mass [m]
  Vec3d linear = Vec3d::Zero();   // [kg m/s]
  Vec3d angular = Vec3d::Zero();  // about the centre [kg m^2/s]
  Mat3d inertia = Mat3d::Zero();  // about the centre [kg m^2]
  double kinetic_energy = 0.0;    // [J]
};

// Adds up point masses.
class MomentSums {
 public:
  void add(double mass, const Vec3d& x, const Vec3d& velocity);
  void add(const MomentSums& other);
  // x was measured from `origin`.
  Momenta momenta(const Vec3d& origin) const;

 private:
  double mass_ = 0.0, energy_ = 0.0;
  Vec3d first_ = Vec3d::Zero(), linear_ = Vec3d::Zero(), angular_ = Vec3d::Zero();
  Mat3d second_ = Mat3d::Zero();
};

// Of several bodies as one.
Momenta joined(std::span<const Momenta> parts);

// v(x) = linear + angular x (x - center)
struct RigidMotion {
  Vec3d center = Vec3d::Zero(), linear = Vec3d::Zero(), angular = Vec3d::Zero();
  Vec3d at(const Vec3d& x) const { return linear + angular.cross(x - center); }
};
// Of a rigid body with these momenta; none where its mass or its inertia vanishes.
RigidMotion rigid_motion(const Momenta& momenta);
// The same for a body constrained by plane walls along some axes (bit a: axis a): it slides along the others, and turns
// about the axis of the only wall.
RigidMotion rigid_motion(const Momenta& momenta, unsigned fixed_axes);
// By an axis times an angle [rad].
Mat3d rotation(const Vec3d& turn);
// Where a step takes a body, and the velocity that it has then: a point at y goes to center + shift + R (y - center), R
// the rotation by `turn`.
struct BodyStep {
  RigidMotion velocity;
  Vec3d shift = Vec3d::Zero();  // [m]
  Vec3d turn = Vec3d::Zero();   // axis times angle [rad]
  AffineFlow flow = {};         // before that, of what walls hold, which does not turn
};
// At one velocity.
BodyStep steady_step(const RigidMotion& velocity, double dt);
// Of a free body whose momenta a step changes before it moves: by the mean of both velocities. What turns a body keeps
// its direction while its moments of inertia turn with it, so that it turns about the axis that it has halfway.
BodyStep free_step(const Momenta& before, const Momenta& after, double dt);
// Of a body constrained by walls along some axes, its velocity field not seen from a frame: what the mean of both
// velocities moves it further along the others than the last one does.
BodyStep constrained_step(const Momenta& before, const Momenta& after, unsigned fixed_axes, double dt);
// What `now` lacks to have the momenta of `target`, whose centre is the same but for what the body has moved.
RigidMotion missing_motion(const Momenta& target, const Momenta& now);

// Of the masses work.mass and a velocity on the band's nodes or on those of the whole grid.
Momenta measure_momenta(const Parallel& parallel, const Band& band, const SolidWork& work, const Grid& nodes,
                        const VectorField& velocity);

// Gives state.v the linear and angular momentum of `target`.
void restore_momenta(const Parallel& parallel, const Momenta& target, const SolidWork& work, SolidState& state);

}  // namespace efsi::solid
