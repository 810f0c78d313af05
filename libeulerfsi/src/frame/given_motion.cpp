#include "frame/given_motion.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace efsi::sim {
namespace {

constexpr double kAtEnd = 1e-9;  // part of the motion: rounding of times

// Axis times angle of the smaller turn.
Vec3d turn_between(const Mat3d& from, const Mat3d& to) {
  const Eigen::AngleAxisd turn(Mat3d(to * from.transpose()));
  return turn.angle() * turn.axis();
}

}  // namespace

Pose PrescribedMotion::pose(double time) const {
  if (from == to || !(end > start)) return to;
  const double s = (time - start) / (end - start);
  if (s <= kAtEnd) return from;
  if (s >= 1.0 - kAtEnd) return to;
  Pose pose;
  pose.turn = solid::rotation(s * turn_between(from.turn, to.turn)) * from.turn;
  pose.shift = (1.0 - s) * from.place(center) + s * to.place(center) - pose.turn * center;
  return pose;
}

solid::RigidMotion PrescribedMotion::velocity(double time, double t, double dt) const {
  solid::RigidMotion motion;
  const double middle = t + 0.5 * dt;
  if (from == to || !(end > start) || middle <= start || middle >= end) return motion;
  motion.center = pose(time).place(center);
  motion.linear = (to.place(center) - from.place(center)) / (end - start);
  motion.angular = turn_between(from.turn, to.turn) / (end - start);
  return motion;
}

std::vector<Vec3d> PointMotion::at(double time) const {
  if (from == to || !(end > start)) return to;
  const double s = (time - start) / (end - start);
  if (s <= kAtEnd) return from;
  if (s >= 1.0 - kAtEnd) return to;
  std::vector<Vec3d> points(to.size());
  for (std::size_t v = 0; v < points.size(); ++v) points[v] = (1.0 - s) * from[v] + s * to[v];
  return points;
}

std::vector<Vec3d> PointMotion::velocity(double t, double dt) const {
  const double middle = t + 0.5 * dt;
  if (from == to || !(end > start) || middle <= start || middle >= end) return {};
  std::vector<Vec3d> velocity(to.size());
  for (std::size_t v = 0; v < velocity.size(); ++v) velocity[v] = (to[v] - from[v]) / (end - start);
  return velocity;
}

namespace {

// Nearest point of a triangle, edge or point to x (Ericson, Real-Time Collision Detection, 5.1.5).
Vec3d nearest_point(const Vec3d& x, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d ab = b - a, ac = c - a, ax = x - a;
  const Vec3d normal = ab.cross(ac);
  const double square = normal.squaredNorm();
  if (square > 0.0) {
    const double v = normal.dot(ax.cross(ac)) / square, w = normal.dot(ab.cross(ax)) / square;
    if (v >= 0.0 && w >= 0.0 && v + w <= 1.0) return a + v * ab + w * ac;
  }
  Vec3d best = a;
  for (const auto& [p, q] : {std::pair{a, b}, std::pair{b, c}, std::pair{c, a}}) {
    const double length = (q - p).squaredNorm();
    const double s = length > 0.0 ? std::clamp((q - p).dot(x - p) / length, 0.0, 1.0) : 0.0;
    const Vec3d y = p + s * (q - p);
    if ((y - x).squaredNorm() < (best - x).squaredNorm()) best = y;
  }
  return best;
}

// Lowers the distances around a triangle.
void include(const Vec3d& a, const Vec3d& b, const Vec3d& c, double reach, geometry::SignedDistance& region) {
  const Vec3d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
  Vec3i first, last;
  for (std::size_t s = 0; s < 3; ++s) {
    const auto i = static_cast<Eigen::Index>(s);
    const double from = (low[i] - 2.0 * reach - region.origin[i]) / region.spacing;
    const double to = (high[i] + 2.0 * reach - region.origin[i]) / region.spacing;
    first[s] = std::max(0, static_cast<int>(std::floor(from)));
    last[s] = std::min(region.size[s] - 1, static_cast<int>(std::ceil(to)));
  }
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i) {
        const Vec3d x = region.node(i, j, k);
        float& value = region.values[region.index(i, j, k)];
        value = std::min(value, static_cast<float>((nearest_point(x, a, b, c) - x).norm() - reach));
      }
}

}  // namespace

geometry::SignedDistance region_of(const geometry::TriangleMesh& surface, const std::vector<std::uint8_t>& marked,
                                   double h) {
  constexpr double kDepth = 1.001;   // cells
  constexpr double kSpacing = 0.25;  // cells
  const double reach = kDepth * h;
  const auto holds = [&](std::int32_t v) { return marked[static_cast<std::size_t>(v)] != 0; };
  Eigen::AlignedBox3d box;
  for (std::size_t v = 0; v < marked.size(); ++v)
    if (marked[v]) box.extend(surface.points[v]);
  geometry::SignedDistance region;
  region.spacing = kSpacing * h;
  region.size = {2, 2, 2};
  if (!box.isEmpty()) {
    region.origin = box.min() - Vec3d::Constant(2.0 * reach);
    for (std::size_t a = 0; a < 3; ++a)
      region.size[a] =
          2 + static_cast<int>(std::ceil((box.sizes()[static_cast<Eigen::Index>(a)] + 4.0 * reach) / region.spacing));
  }
  region.values.assign(static_cast<std::size_t>(region.size[0]) * static_cast<std::size_t>(region.size[1]) *
                           static_cast<std::size_t>(region.size[2]),
                       static_cast<float>(reach));
  for (std::size_t v = 0; v < marked.size(); ++v)
    if (marked[v]) include(surface.points[v], surface.points[v], surface.points[v], reach, region);
  for (const geometry::Triangle& t : surface.triangles) {
    const Vec3d &a = surface.points[static_cast<std::size_t>(t[0])],
                &b = surface.points[static_cast<std::size_t>(t[1])],
                &c = surface.points[static_cast<std::size_t>(t[2])];
    if (holds(t[0]) && holds(t[1]) && holds(t[2])) include(a, b, c, reach, region);
    if (holds(t[0]) && holds(t[1])) include(a, b, b, reach, region);
    if (holds(t[1]) && holds(t[2])) include(b, c, c, reach, region);
    if (holds(t[2]) && holds(t[0])) include(c, a, a, reach, region);
  }
  return region;
}

bool is_pinned(const std::vector<Pin>& pins, std::size_t solid) {
  return std::any_of(pins.begin(), pins.end(), [&](const Pin& pin) { return pin.solid == solid; });
}

bool is_collider(const std::vector<Pin>& pins, std::size_t solid) {
  return std::any_of(pins.begin(), pins.end(), [&](const Pin& pin) { return pin.whole && pin.solid == solid; });
}

}  // namespace efsi::sim
