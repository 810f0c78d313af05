#include "contact/wall_friction.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <utility>

namespace efsi::sim {
namespace {

constexpr double kSticksBeyond = 1.1;  // of mu times the normal impulse, which the solves leave uncertain at rest

// What the rows of a solid at one face exert in the step.
struct FaceContact {
  double normal = 0.0;             // impulse [kg m/s]
  Vec3d friction = Vec3d::Zero();  // impulse [kg m/s]
  bool sticks = false;             // one of them does
  double last = 0.0;               // mu times the normal impulse that the last step's force has in this one
  double weight = 0.0;             // of the means below: the normal impulses that are not tensile
  Vec3d first = Vec3d::Zero();     // of the places
  Vec3d along = Vec3d::Zero();     // of the velocities along the face
};

void add(const WallRow& row, const Vec3d& place, Vec3d v, FaceContact& face) {
  face.normal += static_cast<double>(row.normal_impulse);
  if (row.friction_state == FrictionState::kSlides)
    face.friction -= static_cast<double>(row.limit) * row.sliding_direction.cast<double>();
  if (row.friction_state == FrictionState::kSticks) face.friction += row.friction_impulse.cast<double>();
  face.last += static_cast<double>(row.limit);
  face.sticks = face.sticks || row.friction_state == FrictionState::kSticks;
  const double weight = std::max(0.0, static_cast<double>(row.normal_impulse));
  for (int a = 0; a < 3; ++a)
    if (!(row.tangents & (1u << a))) v[a] = 0.0;
  face.weight += weight;
  face.first += weight * place;
  face.along += weight * v;
}

// The impulse that stops a point of a body at `arm` from its centre along a direction, per speed [kg].
double felt_mass(const solid::Momenta& body, const Vec3d& arm, const Vec3d& direction) {
  const Vec3d turn = body.inertia.ldlt().solve(arm.cross(direction));
  const double mobility = 1.0 / body.mass + direction.dot(turn.cross(arm));
  return mobility > 0.0 && std::isfinite(mobility) ? 1.0 / mobility : 0.0;
}

// What Coulomb's law asks of a face beyond its friction in the step. limit: mu times its normal impulse.
Vec3d missing(const FaceContact& face, double limit, const solid::Momenta& body, const Vec3d& arm) {
  const double friction = face.friction.norm();
  const bool lasts = face.sticks && face.last <= kSticksBeyond * limit;  // and does not unload
  if (friction > limit * (lasts ? kSticksBeyond : 1.0)) return (limit / friction - 1.0) * face.friction;
  if (face.sticks || !(face.weight > 0.0)) return Vec3d::Zero();
  const Vec3d v = face.along / face.weight;
  const Vec3d against = friction > 0.0 ? Vec3d(face.friction / friction) : Vec3d(-v.stableNormalized());
  const double speed = -against.dot(v);
  return std::clamp(limit - friction, 0.0, felt_mass(body, arm, against) * std::max(0.0, speed)) * against;
}

}  // namespace

std::vector<RigidImpulse> missing_friction(const Scene& scene, const std::vector<WallRow>& rows,
                                           const NodeVelocity& velocity, const grid::Grid& common,
                                           const std::vector<solid::Momenta>& momenta) {
  std::map<std::pair<std::size_t, int>, FaceContact> faces;  // solid, face of the box
  for (const WallRow& row : rows) {
    if (!(scene.solids[row.solid].friction > 0.0)) continue;
    FaceContact& face = faces[{row.solid, 2 * row.axis + (row.out > 0 ? 0 : 1)}];
    const auto [i, j, k] = common.node_place(row.node);
    if (row.holds)
      add(row, common.node_position(i, j, k),
          velocity.slip.velocity_of(row.solid, row.node, velocity.field).cast<double>(), face);
    else
      face.normal += static_cast<double>(row.normal_impulse);
  }
  std::vector<RigidImpulse> impulses(faces.empty() ? 0 : momenta.size());
  for (const auto& [key, face] : faces) {
    const solid::Momenta& body = momenta[key.first];
    if (!(body.mass > 0.0)) continue;
    const Vec3d arm = face.weight > 0.0 ? Vec3d(face.first / face.weight - body.center) : Vec3d::Zero();
    const double limit = scene.solids[key.first].friction * std::max(0.0, face.normal);
    impulses[key.first].add(arm, missing(face, limit, body, arm));
  }
  return impulses;
}

}  // namespace efsi::sim
