#include "given/given_shape.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "frame/slab_state.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kFlat = 1e-12;  // square of the sine of an angle of a triangle that has no normal
constexpr double kWholeInSlab = 0.05;
constexpr double kWhole = 1e-3;  // relative difference between a mesh's volume and that of the solid that it bounds
constexpr double kReach = 8.0;   // spacings of the distance, half a cell each: farther out w is 0
constexpr double kMostCorrection = 0.5;  // by which a normal velocity is changed, over itself

// Grad w of a shell on the triangle a b c whose corners move so.
Mat3d shell_gradient(const std::array<Vec3d, 3>& x, const std::array<Vec3d, 3>& w) {
  const Vec3d e1 = x[1] - x[0], e2 = x[2] - x[0], d1 = w[1] - w[0], d2 = w[2] - w[0];
  const Vec3d area = e1.cross(e2);
  const double square = area.squaredNorm();
  if (!(square > kFlat * e1.squaredNorm() * e2.squaredNorm())) return Mat3d::Zero();
  const Vec3d n = area / std::sqrt(square);
  // Vectors that are 1 with one edge and 0 with the other and with n.
  const Vec3d r1 = e2.cross(area) / square, r2 = area.cross(e1) / square;
  const Mat3d along = d1 * r1.transpose() + d2 * r2.transpose();
  return along - along.transpose() * n * n.transpose();
}

// Whether two sets of points are the same, whatever they are along an axis, or along none (-1).
bool same_points(const std::vector<Vec3d>& one, const std::vector<Vec3d>& other, int axis) {
  return std::equal(one.begin(), one.end(), other.begin(), other.end(), [&](const Vec3d& a, const Vec3d& b) {
    for (int i = 0; i < 3; ++i)
      if (i != axis && a[i] != b[i]) return false;
    return true;
  });
}

// Per node of the band: the flux of a velocity v out of the elements is the sum of v times these [m^2].
std::vector<Vec3d> element_areas(const Grid& g, const solid::SolidWork& work) {
  const auto corner = grid::corner_offsets(g);
  const double quarter = 0.25 * g.h * g.h;
  std::vector<Vec3d> areas(g.node_count(), Vec3d::Zero());
  for (const std::int32_t lowest : work.element_corner)
    for (std::size_t c = 0; c < 8; ++c)
      for (int a = 0; a < 3; ++a)
        areas[static_cast<std::size_t>(lowest) + corner[c]][a] += grid::kCorner[c][a] ? quarter : -quarter;
  return areas;
}

}  // namespace

ShapeVelocity::ShapeVelocity(std::shared_ptr<const solid::PrescribedShape> shape, std::vector<Vec3d> velocities)
    : shape_(std::move(shape)), velocities_(std::move(velocities)) {
  Eigen::AlignedBox3d box;
  for (const Vec3d& w : velocities_) box.extend(w);
  if (moves()) range_ = box.diagonal().norm();
}

Vec3d ShapeVelocity::at(const Vec3d& X) const {
  if (!moves()) return Vec3d::Zero();
  const geometry::TriangleMesh& mesh = shape_->surface->mesh;
  const geometry::SignedDistance& distance = shape_->surface->distance;
  const double phi = distance.sample(X);
  if (phi > kReach * distance.spacing) return Vec3d::Zero();
  // A search that starts at the surface is short.
  const std::int32_t found = shape_->nearest.find(X - phi * distance.gradient(X).stableNormalized()).triangle;
  if (found < 0) return Vec3d::Zero();
  const geometry::Triangle& t = mesh.triangles[static_cast<std::size_t>(found)];
  std::array<Vec3d, 3> x, w;
  for (std::size_t c = 0; c < 3; ++c) {
    x[c] = mesh.points[static_cast<std::size_t>(t[c])];
    w[c] = velocities_[static_cast<std::size_t>(t[c])];
  }
  const Vec3d P = geometry::closest_point(x[0], x[1], x[2], X), middle = (x[0] + x[1] + x[2]) / 3.0;
  const Mat3d gradient = shell_gradient(x, w);
  const Vec3d off = gradient * (X - P);
  return (w[0] + w[1] + w[2]) / 3.0 + gradient * (P - middle) + (off.norm() > range_ ? range_ / off.norm() : 1.0) * off;
}

PinVelocity velocity_of(const Pin& pin, const solid::SolidState& state, double time, double t, double dt) {
  PinVelocity velocity{pin.motion.pose(time), pin.motion.velocity(time, t, dt), {}};
  if (state.shape) velocity.points = ShapeVelocity(state.shape, pin.points.velocity(t, dt));
  return velocity;
}

void update_shape(const Parallel& parallel, const Scene& scene, const Pin& pin, double time, solid::SolidState& state) {
  if (!pin.points.given()) return;
  const solid::SolidRest& rest = scene.solids[pin.solid];
  const std::optional<geometry::Slab> slab = slab_of(scene.params, scene.grid);
  geometry::TriangleMesh mesh{pin.points.at(time), rest.surface.triangles};
  if (state.shape && same_points(state.shape->surface->mesh.points, mesh.points, slab ? slab->axis : -1)) return;
  auto shape = std::make_shared<solid::PrescribedShape>();
  try {
    shape->surface = geometry::examine_moved(std::move(mesh), rest.distance.spacing, parallel);
    if (slab) shape->surface = geometry::extrude_in_slab(*shape->surface, *slab, parallel);
  } catch (const Error& error) {
    throw Error(error.code(), "collider " + std::to_string(pin.solid + 1) + ": its points at " + std::to_string(time) +
                                  " s: " + error.what());
  }
  shape->nearest = geometry::NearestTriangle(shape->surface->mesh);
  state.shape = std::move(shape);
}

void keep_volume(const Scene& scene, const PinVelocity& velocity, double dt, const solid::SolidState& state,
                 const solid::SolidWork& work, const Grid& common, std::span<PrescribedNode> given) {
  const Grid& box = scene.grid;
  const geometry::Surface& surface = *state.shape->surface;
  const double mesh = geometry::signed_volume(surface.mesh), volume = surface.report.solid_volume;
  const double part = std::abs(mesh) / volume;  // in a slab the mesh ends a little inside its faces
  if (std::abs(part - 1.0) > (surface.distance.flat < 0 ? kWhole : kWholeInSlab)) return;
  const Vec3d top = box.node_position(box.cells[0], box.cells[1], box.cells[2]);
  for (const Vec3d& x : state.surface)
    if ((x - box.origin).minCoeff() < 0.0 || (top - x).minCoeff() < 0.0) return;

  std::vector<Vec3d> moved = velocity.points.points();
  for (std::size_t v = 0; v < moved.size(); ++v) moved[v] += dt * velocity.points.velocities()[v];
  const double growth = (geometry::signed_volume(moved, surface.mesh.triangles) - mesh) / (part * dt);
  const std::vector<Vec3d> areas = element_areas(state.band.grid, work);
  const Vec3i lo = grid::offset(state.band.grid, common);
  std::vector<Vec3d> push(given.size(), Vec3d::Zero());
  double flux = 0.0, more = 0.0;  // out of the elements: that of the given velocities, that of `push` [m^3/s]
  for (std::size_t i = 0; i < given.size(); ++i) {
    const Vec3i at = common.node_place(given[i].node);
    const Vec3d& area = areas[state.band.grid.node(at[0] - lo[0], at[1] - lo[1], at[2] - lo[2])];
    if (area.isZero()) continue;
    const Vec3d X = velocity.pose.material(common.node_position(at[0], at[1], at[2]));
    const Vec3d normal = surface.distance.gradient(X).normalized();
    push[i] = velocity.pose.turn * (std::abs(normal.dot(velocity.points.at(X))) * normal);
    flux += area.dot(given[i].velocity.cast<double>());
    more += area.dot(push[i]);
  }
  if (!(more > 0.0)) return;
  const double missing =
      std::clamp((std::copysign(1.0, mesh) * growth - flux) / more, -kMostCorrection, kMostCorrection);
  for (std::size_t i = 0; i < given.size(); ++i) given[i].velocity += (missing * push[i]).cast<Real>();
}

}  // namespace efsi::sim
