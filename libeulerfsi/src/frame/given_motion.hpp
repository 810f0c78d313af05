// Purpose: prescribed motion: the pose of a rigid body between two poses, and its velocity there; what is pinned
// so: a region of a solid (a pin) or all of it (a collider).
#pragma once

#include <memory>
#include <vector>

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "solid/momentum.hpp"

namespace efsi::sim {

// A rigid placement: what is at X at rest is at turn X + shift.
struct Pose {
  Mat3d turn = Mat3d::Identity();
  Vec3d shift = Vec3d::Zero();  // [m]
  Vec3d place(const Vec3d& X) const { return turn * X + shift; }
  Vec3d material(const Vec3d& x) const { return turn.transpose() * (x - shift); }
  bool operator==(const Pose& other) const = default;
};

// From one pose to the next: `center` goes straight ahead at one speed while the body turns about it at one rate, by
// the smaller angle. Before `start` and after `end` it rests. At first it rests where it is.
struct PrescribedMotion {
  double start = 0.0, end = 0.0;  // [s]
  Pose from, to;
  Vec3d center = Vec3d::Zero();  // at rest [m]

  Pose pose(double time) const;
  // Velocity in the middle of a step from t to t + dt, of what is in the pose of `time`.
  solid::RigidMotion velocity(double time, double t, double dt) const;
};

// Vertices of a collider in material space between two times: each goes straight ahead at one speed. Before `start` and
// after `end` they rest.
struct PointMotion {
  double start = 0.0, end = 0.0;  // [s]
  std::vector<Vec3d> from, to;    // [m]; empty: they are where the surface has them at rest

  bool given() const { return !to.empty(); }
  std::vector<Vec3d> at(double time) const;
  // Velocities in the middle of a step from t to t + dt [m/s]; empty: all rest.
  std::vector<Vec3d> velocity(double t, double dt) const;
};

// Nodes and vertices of a solid whose material lies in a region have prescribed motion.
struct Pin {
  std::size_t solid = 0;
  bool whole = false;  // all of the solid: it is a collider
  // Material space; < 0 inside; empty of a collider.
  std::shared_ptr<const geometry::SignedDistance> region = std::make_shared<const geometry::SignedDistance>();
  std::vector<std::uint8_t> vertices;               // of the solid's surface: 1: in the region
  Vec3d low = Vec3d::Zero(), high = Vec3d::Zero();  // box around what moves [m]
  PrescribedMotion motion;
  PointMotion points;  // of a collider; `motion` is applied to them

  bool holds(const Vec3d& X) const { return whole || region->sample(X) <= 0.0; }
};

// Reaction of a pin during one step.
struct PinReaction {
  Vec3d impulse = Vec3d::Zero();          // [kg m/s]
  Vec3d angular_impulse = Vec3d::Zero();  // about `center` [kg m^2/s]
  Vec3d center = Vec3d::Zero();           // of the given motion at the start of the step [m]
  double work = 0.0;                      // [J]

  // An impulse at x, where the given motion has a velocity.
  void add(const Vec3d& x, const Vec3d& more, const Vec3d& velocity) {
    impulse += more;
    angular_impulse += (x - center).cross(more);
    work += more.dot(velocity);
  }
};

// What lies within a cell of a surface's marked vertices, of edges and triangles between such.
geometry::SignedDistance region_of(const geometry::TriangleMesh& surface, const std::vector<std::uint8_t>& marked,
                                   double h);

// Whether a part of a solid has prescribed motion, and whether all of it does.
bool is_pinned(const std::vector<Pin>& pins, std::size_t solid);
bool is_collider(const std::vector<Pin>& pins, std::size_t solid);

}  // namespace efsi::sim
