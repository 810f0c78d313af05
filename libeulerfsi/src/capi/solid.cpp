// Purpose: solid.h: meshes and elastic solids.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/mesh_view.hpp"
#include "capi/solid_id.hpp"
#include "frame/parameter_table.inc"
#include "geometry/mesh_sdf.hpp"
#include "geometry/overlap.hpp"
#include "geometry/slab.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

EfsiStatus efsi_mesh_load(const char* path, EfsiMesh** mesh, EfsiError* error) {
  if (mesh) *mesh = nullptr;
  return guarded(error, [&] {
    demand_path(path, "efsi_mesh_load: path");
    demand(mesh, "efsi_mesh_load: mesh");
    *mesh = new EfsiMesh{efsi::io::read_mesh(path)};
  });
}

EfsiStatus efsi_mesh_get_view(const EfsiMesh* mesh, EfsiMeshView* view) {
  if (!mesh || !view) return EFSI_ERROR_ARGUMENT;
  *view = EfsiMeshView{};
  const efsi::io::PolygonMesh& polygons = mesh->polygons;
  view->points = polygons.points.front().data();
  view->point_count = polygons.points.size();
  view->point_stride = sizeof(polygons.points.front());
  view->face_vertex_counts = polygons.face_vertex_counts.data();
  view->face_count = polygons.face_vertex_counts.size();
  view->face_vertex_indices = polygons.face_vertex_indices.data();
  view->index_count = polygons.face_vertex_indices.size();
  return EFSI_OK;
}

void efsi_mesh_destroy(EfsiMesh* mesh) { delete mesh; }

EfsiStatus efsi_surface_create(const EfsiMeshView* mesh, double voxel_size, int32_t threads,
                               EfsiSurfaceProgress progress, void* user, EfsiSurface** surface, EfsiError* error) {
  if (surface) *surface = nullptr;
  return guarded(error, [&] {
    demand(mesh, "efsi_surface_create: mesh");
    demand(surface, "efsi_surface_create: surface");
    check("efsi_surface_create: voxel_size", voxel_size, {0.0, kInfinity, true});
    check("efsi_surface_create: threads", threads, {0.0, 1024.0, false});
    efsi::Progress forward;
    if (progress) forward = efsi::Progress([&](double fraction) { return progress(user, fraction) != 0; });
    const efsi::Parallel parallel(efsi::sim::thread_count(threads));
    *surface = new EfsiSurface{efsi::geometry::examine(read_view(*mesh, "EfsiMeshView"),
                                                       efsi::sim::kRestSpacing * voxel_size, parallel, forward)};
  });
}

EfsiStatus efsi_surface_get_report(const EfsiSurface* surface, EfsiMeshReport* report) {
  if (!surface || !report) return EFSI_ERROR_ARGUMENT;
  *report = to_c(surface->surface->report);
  return EFSI_OK;
}

const char* efsi_surface_get_repair_text(const EfsiSurface* surface) {
  return surface ? surface->surface->report.repairs.c_str() : "";
}

EfsiStatus efsi_surface_get_overlap(const EfsiSurface* a, const EfsiSurface* b, double* depth, double* volume,
                                    EfsiError* error) {
  return guarded(error, [&] {
    demand(a, "efsi_surface_get_overlap: a");
    demand(b, "efsi_surface_get_overlap: b");
    const efsi::geometry::Overlap found = efsi::geometry::overlap(a->surface->distance, b->surface->distance);
    if (depth) *depth = found.depth;
    if (volume) *volume = found.volume;
  });
}

EfsiStatus efsi_surface_extrude_in_slab(const EfsiSurface* surface, int32_t axis, double low, double high,
                                        EfsiSurface** slab, EfsiError* error) {
  if (slab) *slab = nullptr;
  return guarded(error, [&] {
    demand(surface, "efsi_surface_extrude_in_slab: surface");
    demand(slab, "efsi_surface_extrude_in_slab: slab");
    if (axis < 0 || axis > 2)
      throw Error(ErrorCode::kArgument,
                  "efsi_surface_extrude_in_slab: axis = " + std::to_string(axis) + ": must be 0 to 2");
    if (!(low < high) || !std::isfinite(high - low))
      throw Error(ErrorCode::kArgument, "efsi_surface_extrude_in_slab: low = " + std::to_string(low) +
                                            ": must be below high = " + std::to_string(high));
    *slab = new EfsiSurface{efsi::geometry::extrude_in_slab(*surface->surface, {axis, low, high})};
  });
}

void efsi_surface_destroy(EfsiSurface* surface) { delete surface; }

EfsiStatus efsi_solid_def_init(EfsiSolidDef* def) {
  if (!def) return EFSI_ERROR_ARGUMENT;
  start_definition(*def);
#define EFSI_DEFAULT(name, field, kind, initial, min, max, exclusive, unit) def->field = initial;
  EFSI_SOLID_PARAMETERS(EFSI_DEFAULT)
#undef EFSI_DEFAULT
  return EFSI_OK;
}

EfsiStatus efsi_solid_add(EfsiSim* sim, const EfsiSolidDef* def, uint32_t* id, EfsiMeshReport* report) {
  return guarded(sim, [&] {
    demand(def, "efsi_solid_add: def");
    check_definition(*def);
    efsi::geometry::MeshReport found;
    const std::size_t index = sim->simulation.add_solid(to_body(*def), found);
    if (id) *id = static_cast<uint32_t>(index + 1);
    if (report) *report = to_c(found);
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
