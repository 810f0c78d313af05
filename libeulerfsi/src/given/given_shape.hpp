// Purpose: colliders whose points are given: their surface at a time, and the velocity that its points give to what is
// near them (docs/numerics/given-motion.md):
//   w(X) = w(P) + G (X - P),   P the nearest point of the surface, G grad w there; 0 more than four cells outside
// G is that of a shell: along the triangle what its corners say, along the normal, which keeps its length and turns
// with the triangle. What moves rigidly, moves so at all X. |G (X - P)| is at most the range of the w of the surface.
#pragma once

#include <span>
#include <vector>

#include "frame/scene.hpp"
#include "given/given_node.hpp"

namespace efsi::sim {

// Velocities of a surface's points, material space. Keeps the shape alive.
class ShapeVelocity {
 public:
  ShapeVelocity() = default;  // all rest
  ShapeVelocity(std::shared_ptr<const solid::PrescribedShape> shape, std::vector<Vec3d> velocities);

  bool moves() const { return !velocities_.empty(); }
  const std::vector<Vec3d>& points() const { return shape_->surface->mesh.points; }  // [m]
  const std::vector<Vec3d>& velocities() const { return velocities_; }               // per point [m/s]
  Vec3d at(const Vec3d& X) const;                                                    // [m/s]

 private:
  std::shared_ptr<const solid::PrescribedShape> shape_;
  std::vector<Vec3d> velocities_;
  double range_ = 0.0;  // diagonal of the box around them [m/s]
};

// Motion of pinned material: v = V + omega x (x - c) + R w(X), x = R X + s.
struct PinVelocity {
  Pose pose;
  solid::RigidMotion motion;
  ShapeVelocity points;
  Vec3d at(const Vec3d& x, const Vec3d& X) const {
    return points.moves() ? Vec3d(motion.at(x) + pose.turn * points.at(X)) : motion.at(x);
  }
};
// In a step from t to t + dt, of what is in the pose of `time`. state: of the pin's solid, its shape that of `time`.
PinVelocity velocity_of(const Pin& pin, const solid::SolidState& state, double time, double t, double dt);

// Where the points of a collider are given: makes its shape that of `time`, if it is not that already.
// Throws Error(kMesh) where they bound no volume.
void update_shape(const Parallel& parallel, const Scene& scene, const Pin& pin, double time, solid::SolidState& state);

// The given nodes of a collider lie beside its surface, not on it: the volume they displace is not that of the surface.
// Changes their normal velocities, in proportion to those that the points give them, so that the flux out of its
// elements is dV/dt of the surface. Does nothing where it reaches out of the box, or crosses itself.
void keep_volume(const Scene& scene, const PinVelocity& velocity, double dt, const solid::SolidState& state,
                 const solid::SolidWork& work, const grid::Grid& common, std::span<PrescribedNode> given);

}  // namespace efsi::sim
