// Purpose: solid.h: elastic solids.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/mesh_view.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

EfsiStatus efsi_solid_def_init(EfsiSolidDef* def, size_t size) { return initialise(def, size); }

EfsiStatus efsi_solid_add(EfsiSim* sim, const EfsiSolidDef* def, uint32_t* id) {
  return guarded(sim, [&] {
    const EfsiSolidDef full = receive(def, "efsi_solid_add: def");
    efsi::geometry::MeshReport found;
    const std::size_t index = sim->simulation.add_solid(to_body(full), found);
    sim->reports.push_back(std::move(found));
    if (id) *id = static_cast<uint32_t>(index + 1);
  });
}

EfsiStatus efsi_solid_get_mesh_report(const EfsiSim* sim, uint32_t id, EfsiMeshReport* report, size_t size) {
  return guarded(sim, [&] {
    const std::size_t index = solid_index(*sim, id, "efsi_solid_get_mesh_report");
    demand(report, "efsi_solid_get_mesh_report: report");
    give(to_c(sim->reports[index]), report, size, "efsi_solid_get_mesh_report");
  });
}

EfsiStatus efsi_solid_get_count(const EfsiSim* sim, uint32_t* count) {
  return guarded(sim, [&] {
    demand(count, "efsi_solid_get_count: count");
    *count = static_cast<uint32_t>(sim->simulation.solids().size());
  });
}

EfsiStatus efsi_solid_get_surface(EfsiSim* sim, uint32_t id, float* points, float* velocities, uint64_t point_count) {
  return guarded(sim, [&] {
    const std::size_t index = solid_index(*sim, id, "efsi_solid_get_surface");
    const std::vector<efsi::Vec3d>& surface = sim->simulation.state().solids[index].surface;
    if (point_count != surface.size())
      throw Error(ErrorCode::kArgument, "efsi_solid_get_surface: point_count = " + std::to_string(point_count) +
                                            ": must be " + std::to_string(surface.size()) +
                                            ", as in the mesh of solid " + std::to_string(id));
    if (points) copy_points(sim->simulation.surface_points(index), points);
    if (velocities) copy_points(sim->simulation.surface_velocity(index), velocities);
  });
}

EfsiStatus efsi_solid_get_diagnostics(EfsiSim* sim, uint32_t id, EfsiSolidDiagnostics* out, size_t size) {
  return guarded(sim, [&] {
    demand(out, "efsi_solid_get_diagnostics: out");
    const std::size_t index = solid_index(*sim, id, "efsi_solid_get_diagnostics");
    give(to_c(sim->simulation.diagnose_solid(index)), out, size, "efsi_solid_get_diagnostics");
  });
}

EfsiStatus efsi_solid_get_transport_error(const EfsiSim* sim, uint32_t id, EfsiTransportError* out, size_t size) {
  return guarded(sim, [&] {
    demand(out, "efsi_solid_get_transport_error: out");
    const std::size_t index = solid_index(*sim, id, "efsi_solid_get_transport_error");
    const auto& transport = sim->simulation.last_step().transport;
    give(index < transport.size() ? to_c(transport[index]) : EfsiTransportError{}, out, size,
         "efsi_solid_get_transport_error");
  });
}
