// Purpose: solid.h: meshes and elastic solids.
#include <cstring>

#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/solid_id.hpp"
#include "geometry/mesh_sdf.hpp"
#include "geometry/overlap.hpp"
#include "sim/parameter_table.inc"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

namespace {

// Triangles of the caller's mesh. owner: "EfsiSolidDef.mesh" for the messages. What the entries hold is checked by
// triangulate(), the shape of the arrays here.
efsi::geometry::TriangleMesh read_view(const EfsiMeshView& view, const std::string& owner) {
  constexpr uint64_t kLargest = std::numeric_limits<std::int32_t>::max();
  constexpr uint64_t kPointBytes = 3 * sizeof(float);
  const auto refuse = [&](const std::string& what) { throw Error(ErrorCode::kArgument, owner + "." + what); };
  if (!view.points) refuse("points is NULL");
  if (!view.face_vertex_indices) refuse("face_vertex_indices is NULL");
  if (view.point_count == 0 || view.point_count > kLargest)
    refuse("point_count = " + std::to_string(view.point_count) + ": must be between 1 and " + std::to_string(kLargest));
  if (view.point_stride != 0 && view.point_stride < kPointBytes)
    refuse("point_stride = " + std::to_string(view.point_stride) + ": must be 0 or at least 12");
  if (view.index_count == 0 || view.index_count > kLargest)
    refuse("index_count = " + std::to_string(view.index_count) + ": must be between 1 and " + std::to_string(kLargest));
  if (view.face_vertex_counts && (view.face_count == 0 || view.face_count > view.index_count))
    refuse("face_count = " + std::to_string(view.face_count) +
           ": must be between 1 and index_count = " + std::to_string(view.index_count));
  if (!view.face_vertex_counts && 3 * view.face_count != view.index_count)
    refuse("index_count = " + std::to_string(view.index_count) +
           ": must be 3 * face_count = " + std::to_string(3 * view.face_count) + " where face_vertex_counts is NULL");

  const uint64_t stride = view.point_stride ? view.point_stride : kPointBytes;
  const char* bytes = reinterpret_cast<const char*>(view.points);
  std::vector<efsi::Vec3d> points(view.point_count);
  for (efsi::Vec3d& x : points) {
    float p[3];
    std::memcpy(p, bytes, sizeof(p));
    x = {p[0], p[1], p[2]};
    bytes += stride;
  }
  std::span<const std::int32_t> counts;
  if (view.face_vertex_counts) counts = {view.face_vertex_counts, view.face_count};
  return efsi::geometry::triangulate(std::move(points), counts, {view.face_vertex_indices, view.index_count});
}

}  // namespace

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

const char* efsi_surface_get_repairs(const EfsiSurface* surface) {
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
    efsi::sim::SolidDesc solid = to_solid(*def);
    if (def->surface) {
      solid.examined = def->surface->surface;
    } else {
      solid.surface = read_view(def->mesh, "EfsiSolidDef.mesh");
    }
    const std::size_t index = sim->simulation.add_solid(solid, found);
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
    if (points) copy_points(surface, points);
    if (velocities) copy_points(sim->simulation.surface_velocity(index), velocities);
  });
}
