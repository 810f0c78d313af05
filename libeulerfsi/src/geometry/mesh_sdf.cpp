// Purpose: from a triangle mesh to the signed distance field of the closed solid that it stands for.
#include "geometry/mesh_sdf.hpp"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <sstream>

#include "base/error.hpp"
#include "geometry/mesh_topology.hpp"
#include "geometry/solid_boundary.hpp"
#include "geometry/thickness.hpp"
#include "geometry/triangle_tree.hpp"

namespace efsi::geometry {

namespace {

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream stream;
  (stream << ... << parts);
  return stream.str();
}

// The mesh as tools::meshToVolume reads it, in index space of the grid.
class IndexSpaceMesh {
 public:
  IndexSpaceMesh(const TriangleMesh& mesh, const SignedDistance& grid) : mesh_(mesh), grid_(grid) {}
  std::size_t polygonCount() const { return mesh_.triangles.size(); }
  std::size_t pointCount() const { return mesh_.points.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t triangle, std::size_t corner, openvdb::Vec3d& point) const {
    const Vec3d x = (mesh_.points[mesh_.triangles[triangle][corner]] - grid_.origin) / grid_.spacing;
    point = openvdb::Vec3d(x.x(), x.y(), x.z());
  }

 private:
  const TriangleMesh& mesh_;
  const SignedDistance& grid_;
};

// Fills grid.values with the distance to the mesh. Which of several nearest triangles a voxel remembers depends on how
// OpenVDB's threads share the work, and the voxels around inherit it: one thread keeps the result the same.
void unsigned_distance(const TriangleMesh& mesh, SignedDistance& grid) {
  grid.values.resize(static_cast<std::size_t>(grid.size[0]) * grid.size[1] * grid.size[2]);
  const float band = static_cast<float>(Vec3d(grid.size[0], grid.size[1], grid.size[2]).norm());
  const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1));
  tbb::task_arena(1).execute([&] {
    const auto distance = openvdb::tools::meshToVolume<openvdb::FloatGrid>(
        IndexSpaceMesh(mesh, grid), openvdb::math::Transform(), band, 0.0f, openvdb::tools::UNSIGNED_DISTANCE_FIELD);
    openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box, grid.values.data());
    openvdb::tools::copyToDense(*distance, dense, /*serial=*/true);
  });
  for (float& value : grid.values) value *= static_cast<float>(grid.spacing);
}

}  // namespace

SignedDistance build_signed_distance(const TriangleMesh& mesh, double spacing, MeshReport& report, const Log& log,
                                     double margin) {
  (void)log; (void)margin; (void)report; (void)spacing; (void)mesh;
  SignedDistance g; 
  return g;
}
}  // namespace efsi::geometry
