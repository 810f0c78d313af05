// Purpose: pin.h: pins and colliders.
#include <Eigen/Geometry>

#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/mesh_view.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

namespace {

constexpr double kRigid = 1e-4;  // difference of R^T R from the identity

efsi::sim::Pose to_pose(const char* argument, const double* matrix) {
  double copy[16];
  std::copy_n(matrix, 16, copy);
  check_transform(argument, copy);
  const Eigen::Matrix4d m = to_matrix(copy);
  const efsi::Mat3d turn = m.topLeftCorner<3, 3>();
  const double off = (turn.transpose() * turn - efsi::Mat3d::Identity()).cwiseAbs().maxCoeff();
  if (off > kRigid || turn.determinant() < 0.0)
    throw Error(ErrorCode::kArgument, std::string(argument) +
                                          ": must be rigid, a rotation and a translation; R^T R is off by " +
                                          std::to_string(off) + ", det R = " + std::to_string(turn.determinant()));
  return {Eigen::Quaterniond(turn).normalized().toRotationMatrix(), m.topRightCorner<3, 1>()};
}

std::size_t pin_index(const EfsiSim& sim, uint32_t id, const char* function) {
  return check_id(id, sim.simulation.pins().size(), std::string(function) + ": id", "pin");
}

}  // namespace

EfsiStatus efsi_pin_add_volume(EfsiSim* sim, uint32_t solid, const EfsiSurface* volume, uint32_t* id) {
  return guarded(sim, [&] {
    const std::size_t index = solid_index(*sim, solid, "efsi_pin_add_volume");
    demand(volume, "efsi_pin_add_volume: volume");
    const std::size_t pin = sim->simulation.add_pin(index, volume->surface->distance);
    if (id) *id = static_cast<uint32_t>(pin + 1);
  });
}

EfsiStatus efsi_pin_add_vertices(EfsiSim* sim, uint32_t solid, const uint8_t* marked, uint64_t count, uint32_t* id) {
  return guarded(sim, [&] {
    const std::size_t index = solid_index(*sim, solid, "efsi_pin_add_vertices");
    demand(marked, "efsi_pin_add_vertices: marked");
    const std::size_t vertices = sim->simulation.solids()[index].surface.points.size();
    if (count != vertices)
      throw Error(ErrorCode::kArgument, "efsi_pin_add_vertices: count = " + std::to_string(count) + ": must be " +
                                            std::to_string(vertices) + ", as in the mesh of solid " +
                                            std::to_string(solid));
    const std::size_t pin = sim->simulation.add_pin(index, std::vector<std::uint8_t>(marked, marked + count));
    if (id) *id = static_cast<uint32_t>(pin + 1);
  });
}

EfsiStatus efsi_collider_add(EfsiSim* sim, const EfsiSolidDef* def, uint32_t* solid, uint32_t* pin) {
  return guarded(sim, [&] {
    const EfsiSolidDef full = receive(def, "efsi_collider_add: def");
    efsi::geometry::MeshReport found;
    const std::size_t index = sim->simulation.add_collider(to_body(full), found);
    sim->reports.push_back(std::move(found));
    if (solid) *solid = static_cast<uint32_t>(sim->simulation.pins()[index].solid + 1);
    if (pin) *pin = static_cast<uint32_t>(index + 1);
  });
}

EfsiStatus efsi_pin_set_motion(EfsiSim* sim, uint32_t id, double start, double end, const double from[16],
                               const double to[16]) {
  return guarded(sim, [&] {
    const std::size_t index = pin_index(*sim, id, "efsi_pin_set_motion");
    demand(from, "efsi_pin_set_motion: from");
    demand(to, "efsi_pin_set_motion: to");
    check("efsi_pin_set_motion: start", start, {0.0, kInfinity, false});
    check("efsi_pin_set_motion: end", end, {start, kInfinity, true});
    sim->simulation.set_motion(index, start, end, to_pose("efsi_pin_set_motion: from", from),
                               to_pose("efsi_pin_set_motion: to", to));
  });
}

EfsiStatus efsi_collider_set_points(EfsiSim* sim, uint32_t pin, double start, double end, const float* from,
                                    const float* to, uint64_t point_count) {
  return guarded(sim, [&] {
    constexpr const char* kName = "efsi_collider_set_points";
    const std::size_t index = pin_index(*sim, pin, kName);
    const efsi::sim::Pin& held = sim->simulation.pins()[index];
    if (!held.whole)
      throw Error(ErrorCode::kArgument, std::string(kName) + ": pin = " + std::to_string(pin) +
                                            ": must be that of a collider; it holds a part of solid " +
                                            std::to_string(held.solid + 1));
    demand(from, "efsi_collider_set_points: from");
    demand(to, "efsi_collider_set_points: to");
    check("efsi_collider_set_points: start", start, {0.0, kInfinity, false});
    check("efsi_collider_set_points: end", end, {start, kInfinity, true});
    const std::size_t points = sim->simulation.solids()[held.solid].surface.points.size();
    if (point_count != points)
      throw Error(ErrorCode::kArgument, std::string(kName) + ": point_count = " + std::to_string(point_count) +
                                            ": must be " + std::to_string(points) + ", as in the mesh of solid " +
                                            std::to_string(held.solid + 1));
    sim->simulation.set_points(index, {start, end, read_points(from, points, std::string(kName) + ": from"),
                                       read_points(to, points, std::string(kName) + ": to")});
  });
}

EfsiStatus efsi_pin_get_reaction(const EfsiSim* sim, uint32_t id, EfsiPinReaction* reaction, size_t size) {
  return guarded(sim, [&] {
    const std::size_t index = pin_index(*sim, id, "efsi_pin_get_reaction");
    demand(reaction, "efsi_pin_get_reaction: reaction");
    const std::vector<efsi::sim::PinReaction>& pins = sim->simulation.last_step().pins;
    give(to_c(index < pins.size() ? pins[index] : efsi::sim::PinReaction{}), reaction, size, "efsi_pin_get_reaction");
  });
}
