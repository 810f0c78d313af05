#include "capi/mesh_view.hpp"

#include <cstring>

#include "capi/convert.hpp"
#include "capi/guard.hpp"

namespace efsi::capi {

geometry::TriangleMesh read_view(const EfsiMeshView& view, const std::string& owner) {
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
  std::vector<Vec3d> points(view.point_count);
  for (Vec3d& x : points) {
    float p[3];
    std::memcpy(p, bytes, sizeof(p));
    x = {p[0], p[1], p[2]};
    bytes += stride;
  }
  std::span<const std::int32_t> counts;
  if (view.face_vertex_counts) counts = {view.face_vertex_counts, view.face_count};
  return geometry::triangulate(std::move(points), counts, {view.face_vertex_indices, view.index_count});
}

sim::SolidDesc to_body(const EfsiSolidDef& def) {
  sim::SolidDesc solid = to_solid(def);
  if (def.surface) {
    solid.examined = def.surface->surface;
  } else {
    solid.surface = read_view(def.mesh, "EfsiSolidDef.mesh");
  }
  return solid;
}

}  // namespace efsi::capi
