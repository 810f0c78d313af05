// Purpose: from a triangle mesh to the signed distance field of the closed solid that it stands for.
#include "geometry/mesh_sdf.hpp"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/MeshToVolume.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
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
  IndexSpaceMesh(const TriangleMesh& mesh, const SignedDistance& grid) : triangles_(mesh.triangles) {
    points_.reserve(mesh.points.size());
    for (const Vec3d& X : mesh.points) {
      const Vec3d x = (X - grid.origin) / grid.spacing;
      points_.emplace_back(x.x(), x.y(), x.z());
    }
  }
  std::size_t polygonCount() const { return triangles_.size(); }
  std::size_t pointCount() const { return points_.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t triangle, std::size_t at, openvdb::Vec3d& point) const {
    point = corner(triangle, at);
  }
  const openvdb::Vec3d& corner(std::size_t triangle, std::size_t at) const { return points_[triangles_[triangle][at]]; }

 private:
  const std::vector<Triangle>& triangles_;
  std::vector<openvdb::Vec3d> points_;
};

double distance_to_triangle(const IndexSpaceMesh& mesh, std::int32_t triangle, const openvdb::Vec3d& X) {
  openvdb::Vec3d weights;
  const openvdb::Vec3d nearest = openvdb::math::closestPointOnTriangleToPoint(
      mesh.corner(triangle, 0), mesh.corner(triangle, 1), mesh.corner(triangle, 2), X, weights);
  return (X - nearest).length();
}

// OpenVDB's voxelization: the nearest triangle of every node within kBand spacings of the mesh, -1 elsewhere. Which of
// several nearest ones is found can depend on how OpenVDB's threads share the work, so there is one thread.
std::vector<std::int32_t> nearest_triangles_in_band(const IndexSpaceMesh& mesh, const Vec3i& size) {
  constexpr float kBand = 3.0f;
  std::vector<std::int32_t> nearest(static_cast<std::size_t>(size[0]) * size[1] * size[2]);
  tbb::task_arena(1).execute([&] {
    openvdb::Int32Grid indices(-1);
    openvdb::util::NullInterrupter interrupter;
    openvdb::tools::meshToVolume<openvdb::FloatGrid>(interrupter, mesh, openvdb::math::Transform(), kBand, 0.0f,
                                                     openvdb::tools::UNSIGNED_DISTANCE_FIELD, &indices);
    const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(size[0] - 1, size[1] - 1, size[2] - 1));
    openvdb::tools::Dense<std::int32_t, openvdb::tools::LayoutXYZ> dense(box, nearest.data());
    openvdb::tools::copyToDense(indices, dense, /*serial=*/true);
  });
  return nearest;
}

// Fills grid.values with the distance to the mesh: nodes outside the band take over the nearest triangle of a
// neighbour, swept through the grid in the eight diagonal directions.
void unsigned_distance(const TriangleMesh& triangles, SignedDistance& grid) {
  const IndexSpaceMesh mesh(triangles, grid);
  std::vector<std::int32_t> nearest = nearest_triangles_in_band(mesh, grid.size);
  std::vector<double> distance(nearest.size(), std::numeric_limits<double>::infinity());
  const auto for_each_node = [&grid](int direction, const auto& visit) {
    const auto along = [&](int axis, int step) { return direction >> axis & 1 ? grid.size[axis] - 1 - step : step; };
    for (int k = 0; k < grid.size[2]; ++k)
      for (int j = 0; j < grid.size[1]; ++j)
        for (int i = 0; i < grid.size[0]; ++i) visit(along(0, i), along(1, j), along(2, k), Vec3i{i, j, k});
  };
  for_each_node(0, [&](int i, int j, int k, const Vec3i&) {
    const std::size_t at = grid.index(i, j, k);
    if (nearest[at] >= 0) distance[at] = distance_to_triangle(mesh, nearest[at], openvdb::Vec3d(i, j, k));
  });
  constexpr double kLength[] = {0.0, 1.0, 1.4142135624, 1.7320508076};
  for (int direction = 0; direction < 8; ++direction) {
    for_each_node(direction, [&](int i, int j, int k, const Vec3i& step) {
      const std::size_t at = grid.index(i, j, k);
      for (int way = 1; way < 8; ++way) {  // along the edges, face diagonals and diagonal of a cell
        Vec3i behind = {i, j, k};
        bool exists = true;
        for (int axis = 0; axis < 3; ++axis) {
          if ((way >> axis & 1) == 0) continue;
          exists = exists && step[axis] > 0;
          behind[axis] += direction >> axis & 1 ? 1 : -1;
        }
        if (!exists) continue;
        const std::size_t from = grid.index(behind[0], behind[1], behind[2]);
        const double apart = kLength[std::popcount(static_cast<unsigned>(way))];
        if (nearest[from] < 0 || nearest[from] == nearest[at] || distance[from] - apart >= distance[at]) continue;
        const double candidate = distance_to_triangle(mesh, nearest[from], openvdb::Vec3d(i, j, k));
        if (candidate >= distance[at]) continue;
        distance[at] = candidate;
        nearest[at] = nearest[from];
      }
    });
  }
  grid.values.resize(distance.size());
  for (std::size_t at = 0; at < distance.size(); ++at)
    grid.values[at] = static_cast<float>(distance[at] * grid.spacing);
}

// Nodes inside become negative; one that lies on the surface is 0, whatever its winding number came to.
void apply_sign(const std::vector<float>& winding, SignedDistance& grid) {
  const float on_surface = static_cast<float>(1e-5 * grid.spacing);
  for (std::size_t at = 0; at < grid.values.size(); ++at) {
    float& phi = grid.values[at];
    phi = phi < on_surface ? 0.0f : winding[at] > kInsideWinding ? -phi : phi;
  }
}

// An empty grid over the box plus the margin.
SignedDistance make_grid(const Extents& box, double spacing, double margin) {
  if (!(spacing > 0.0) || !std::isfinite(spacing))
    throw Error(ErrorCode::kArgument, text("signed distance: spacing = ", spacing, ": must be > 0"));
  if (!(margin >= 1.0) || !std::isfinite(margin))
    throw Error(ErrorCode::kArgument, text("signed distance: margin = ", margin, " spacings: must be at least 1"));
  SignedDistance grid;
  grid.spacing = spacing;
  grid.origin = box.min - Vec3d::Constant(margin * spacing);
  const Vec3d cells = ((box.max - box.min) / spacing).array() + 2.0 * margin;
  double nodes = 1.0;
  for (int axis = 0; axis < 3; ++axis) nodes *= std::ceil(cells[axis]) + 1.0;
  // Per node while the field is built: distances, nearest triangles, winding numbers, marks.
  constexpr double kBytesPerNode = 24.0;
  if (nodes > static_cast<double>(std::numeric_limits<std::int32_t>::max()))
    throw Error(ErrorCode::kMemory, text("signed distance: spacing = ", spacing, " m gives ", nodes, " nodes (",
                                         nodes * kBytesPerNode / 1e9, " GB) over the mesh: at most 2147483647"));
  for (int axis = 0; axis < 3; ++axis) grid.size[axis] = static_cast<int>(std::ceil(cells[axis])) + 1;
  return grid;
}

void warn_about_repairs(const MeshReport& report, const OrientationRepair& turned, std::uint64_t caps,
                        std::int32_t parts, const Log& log) {
  std::string what;
  const auto add = [&what](const std::string& part) { what += (what.empty() ? "" : "; ") + part; };
  if (report.open_edges > 0)
    add(text("open: ", report.holes, report.holes == 1 ? " hole" : " holes", ", the largest ", report.largest_hole,
             " m around, ", caps > 0 ? "closed" : "below the grid's resolution", " by the winding number"));
  if (report.nonmanifold_edges > 0) add(text(report.nonmanifold_edges, " edges with three faces and more"));
  if (turned.turned_mesh) add("inside out: all faces turned");
  if (turned.turned_parts > 0) add(text(turned.turned_parts, " of ", parts, " parts inside out: turned"));
  if (turned.turned_triangles > 0) add(text(turned.turned_triangles, " triangles against their neighbours: turned"));
  if (!what.empty()) log.warning("mesh repaired: " + what);
}

[[noreturn]] void refuse_empty(const MeshReport& report, double spacing) {
  std::string message = text("mesh: encloses no node of the grid at spacing ", spacing, " m (extents ",
                             (report.extent_max - report.extent_min).transpose(), " m");
  if (report.thinnest_feature > 0.0) {
    message += text(", thinnest feature about ", report.thinnest_feature, " m: use a spacing of at most ",
                    0.5 * report.thinnest_feature, " m)");
  } else {
    message += "): it must bound a volume";
  }
  throw Error(ErrorCode::kMesh, message);
}

}  // namespace

SignedDistance build_signed_distance(const TriangleMesh& mesh, double spacing, MeshReport& report, const Log& log,
                                     double margin) {
  report = inspect(mesh);
  TriangleMesh surface = weld(mesh);
  if (surface.triangles.empty())
    throw Error(ErrorCode::kMesh, text("mesh: has ", mesh.triangles.size(), " triangles, none of them with an area"));
  const OrientationRepair turned = orient_outwards(surface);
  const Topology topology = analyse_topology(surface);
  const TriangleTree tree(surface);
  report.thinnest_feature = thinnest_feature(surface, tree);
  report.repaired = !topology.simple();

  SignedDistance grid = make_grid(extents(surface), spacing, margin);
  std::uint64_t caps = 0;
  bool as_given = false;  // the mesh is the boundary of the solid
  try {
    unsigned_distance(surface, grid);
    const bool balanced = topology.unbalanced_edges == 0;
    const std::vector<float> winding = node_winding_numbers(tree, grid, balanced);
    // Surfaces inside the solid and holes: distances to the boundary of the solid instead of those to the mesh.
    const SolidBoundary boundary = solid_boundary(surface, tree, grid, winding, balanced, topology.parts == 1);
    if (boundary.mesh.triangles.empty()) refuse_empty(report, spacing);
    as_given = report.closed && !boundary.differs;
    if (boundary.differs) unsigned_distance(boundary.mesh, grid);
    caps = boundary.cap_triangles;
    apply_sign(winding, grid);
    if (std::none_of(grid.values.begin(), grid.values.end(), [](float phi) { return phi < 0.0f; }))
      refuse_empty(report, spacing);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kMemory, text("signed distance: not enough memory for ", grid.size[0], " x ", grid.size[1],
                                         " x ", grid.size[2], " nodes at spacing ", spacing, " m"));
  }
  // A closed mesh knows its volume better than the grid does.
  report.solid_volume = as_given ? std::abs(report.surface_volume) : grid.volume();
  warn_about_repairs(report, turned, caps, topology.parts, log);
  return grid;
}

}  // namespace efsi::geometry
