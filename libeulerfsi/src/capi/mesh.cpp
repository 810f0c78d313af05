// Purpose: mesh.h: meshes, and surfaces prepared for a voxel size.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/mesh_view.hpp"
#include "capi/sized.hpp"
#include "geometry/mesh_sdf.hpp"
#include "geometry/nearest_triangle.hpp"
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

EfsiStatus efsi_mesh_get_objects(const EfsiMesh* mesh, EfsiMeshObject* objects, size_t object_size, uint64_t capacity,
                                 uint64_t* count, EfsiError* error) {
  return guarded(error, [&] {
    demand(mesh, "efsi_mesh_get_objects: mesh");
    demand(count, "efsi_mesh_get_objects: count");
    *count = mesh->polygons.objects.size();
    if (capacity == 0) return;
    demand(objects, "efsi_mesh_get_objects: objects");
    std::vector<EfsiMeshObject> all;
    for (const efsi::io::MeshObject& object : mesh->polygons.objects)
      all.push_back({object.name.c_str(), object.first_face, object.face_count});
    give_array(all, objects, object_size, capacity, "efsi_mesh_get_objects");
  });
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

EfsiStatus efsi_surface_get_report(const EfsiSurface* surface, EfsiMeshReport* report, size_t size) {
  if (!surface || !report || size > sizeof(EfsiMeshReport)) return EFSI_ERROR_ARGUMENT;
  give(to_c(surface->surface->report), report, size, "efsi_surface_get_report");
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

EfsiStatus efsi_triangles_find_nearest(const double* corners, uint64_t triangle_count, const double* points,
                                       uint64_t point_count, uint32_t* triangles, double* weights, EfsiError* error) {
  return guarded(error, [&] {
    demand(corners, "efsi_triangles_find_nearest: corners");
    demand(points, "efsi_triangles_find_nearest: points");
    demand(triangles, "efsi_triangles_find_nearest: triangles");
    demand(weights, "efsi_triangles_find_nearest: weights");
    constexpr std::uint64_t kMost = std::numeric_limits<std::int32_t>::max() / 3;
    if (triangle_count == 0 || triangle_count > kMost)
      throw Error(ErrorCode::kArgument,
                  "efsi_triangles_find_nearest: triangle_count = " + std::to_string(triangle_count) +
                      ": must be between 1 and " + std::to_string(kMost));
    efsi::geometry::TriangleMesh mesh;
    mesh.points = read_points(corners, 3 * triangle_count, "efsi_triangles_find_nearest: corners");
    for (std::int32_t t = 0; t < static_cast<std::int32_t>(triangle_count); ++t)
      mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    const std::vector<efsi::Vec3d> wanted = read_points(points, point_count, "efsi_triangles_find_nearest: points");
    const efsi::geometry::NearestTriangle tree(mesh);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const auto found = static_cast<std::size_t>(tree.find(wanted[i]).triangle);
      const efsi::Vec3d* corner = &mesh.points[3 * found];
      const efsi::Vec3d weight = efsi::geometry::closest_weights(corner[0], corner[1], corner[2], wanted[i]);
      triangles[i] = static_cast<std::uint32_t>(found);
      for (int c = 0; c < 3; ++c) weights[3 * i + static_cast<std::size_t>(c)] = weight[c];
    }
  });
}
