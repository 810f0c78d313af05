// Purpose: from a triangle mesh to the signed distance field of the closed solid that it stands for.
#include "geometry/mesh_sdf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <optional>
#include <sstream>

#include "base/error.hpp"
#include "geometry/distance_by_levels.hpp"
#include "geometry/distance_to_mesh.hpp"
#include "geometry/mesh_topology.hpp"
#include "geometry/solid_boundary.hpp"
#include "geometry/thickness.hpp"
#include "geometry/triangle_tree.hpp"
#include "geometry/winding_field.hpp"

namespace efsi::geometry {

namespace {

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream stream;
  (stream << ... << parts);
  return stream.str();
}

// Nodes inside become negative; one that lies on the surface is 0, whatever its winding number came to.
void apply_sign(const std::vector<float>& winding, SignedDistance& grid) {
  const float on_surface = static_cast<float>(1e-5 * grid.spacing);
  for (std::size_t at = 0; at < grid.values.size(); ++at) {
    float& phi = grid.values[at];
    phi = phi < on_surface ? 0.0f : winding[at] > kInsideWinding ? -phi : phi;
  }
}

// An empty grid over the box plus at least the margin. Its middle is that of the box: the nodes around a mesh that is
// its own mirror image are mirror images of each other.
SignedDistance make_grid(const Extents& box, double spacing, double margin) {
  if (!(spacing > 0.0) || !std::isfinite(spacing))
    throw Error(ErrorCode::kArgument, text("signed distance: spacing = ", spacing, ": must be > 0"));
  if (!(margin >= 1.0) || !std::isfinite(margin))
    throw Error(ErrorCode::kArgument, text("signed distance: margin = ", margin, " spacings: must be at least 1"));
  SignedDistance grid;
  grid.spacing = spacing;
  constexpr double kWhole = 1e-5;        // cells: extents of whole cells, as single precision has them, stay whole
  constexpr double kNegligible = 1e-12;  // cells
  const Vec3d cells = ((box.max - box.min) / spacing).array() + 2.0 * margin;
  double nodes = 1.0;
  for (int axis = 0; axis < 3; ++axis) nodes *= std::ceil(cells[axis] - kWhole) + 1.0;
  // Per node while the field is built: distances, nearest triangles and their points, winding numbers.
  constexpr double kBytesPerNode = 36.0;
  if (nodes > static_cast<double>(std::numeric_limits<std::int32_t>::max()))
    throw Error(ErrorCode::kMemory, text("signed distance: spacing = ", spacing, " m gives ", nodes, " nodes (",
                                         nodes * kBytesPerNode / 1e9, " GB) over the mesh: at most 2147483647"));
  for (int axis = 0; axis < 3; ++axis) {
    grid.size[axis] = static_cast<int>(std::ceil(cells[axis] - kWhole)) + 1;
    const double more = grid.size[axis] - 1 - cells[axis];
    grid.origin[axis] = box.min[axis] - (margin + (std::abs(more) > kNegligible ? 0.5 * more : 0.0)) * spacing;
  }
  return grid;
}

// "1 hole", "3 holes"
std::string counted(std::uint64_t count, const char* one, const char* many) {
  return text(count, " ", count == 1 ? one : many);
}

std::string describe_repairs(const MeshReport& report, const OrientationRepair& turned, std::uint64_t caps) {
  std::string what;
  const auto add = [&what](const std::string& part) { what += (what.empty() ? "" : "; ") + part; };
  if (report.open_edges > 0)
    add(text("open: ", counted(report.holes, "hole", "holes"), ", the largest ", report.largest_hole, " m around, ",
             caps > 0 ? "closed by the winding number" : "below the resolution of the grid"));
  if (report.nonmanifold_edges > 0)
    add(counted(report.nonmanifold_edges, "edge with three faces and more", "edges with three faces and more"));
  if (report.merged_points > 0) add(counted(report.merged_points, "doubled point: joined", "doubled points: joined"));
  if (turned.turned_mesh) add("inside out: all faces turned");
  if (turned.turned_parts > 0) add(text(turned.turned_parts, " of ", report.pieces, " pieces inside out: turned"));
  if (turned.reversed_triangles > 0)
    add(counted(turned.reversed_triangles, "triangle against its neighbours: turned",
                "triangles against their neighbours: turned"));
  if (report.inner_triangles > 0)
    add(counted(report.inner_triangles, "triangle inside the solid: left out",
                "triangles inside the solid, where surfaces cross or lie within others: left out"));
  return what;
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

enum class Effort { kThorough, kByLevels };

// Turns the triangles of the mesh that are inside out.
SignedDistance build(TriangleMesh& mesh, double spacing, double margin, Effort effort, MeshReport& report,
                     const Parallel& parallel, const Progress& progress) {
  // Inspect, weld and orient the mesh.
  progress.at(0.0);
  report = inspect(mesh);
  std::vector<std::int32_t> kept;
  TriangleMesh surface = weld(mesh, &kept);
  if (surface.triangles.empty())
    throw Error(ErrorCode::kMesh, text("mesh: has ", mesh.triangles.size(), " triangles, none of them with an area"));
  const OrientationRepair turned = orient_outwards(surface);
  for (const std::size_t i : turned.changed) {
    Triangle& t = mesh.triangles[static_cast<std::size_t>(kept[i])];
    std::swap(t[1], t[2]);
  }
  const Topology topology = analyse_topology(surface);
  const TriangleTree tree(surface);
  if (effort == Effort::kThorough)
    report.thinnest_feature = thinnest_feature(surface, tree, parallel, progress.part(0.05, 0.1));
  report.pieces = static_cast<std::uint32_t>(topology.parts);
  report.reversed_triangles = static_cast<std::uint32_t>(turned.changed.size());

  // Distances to the mesh, winding numbers, and the boundary of the solid.
  SignedDistance grid = make_grid(extents(surface), spacing, margin);
  std::uint64_t caps = 0;
  bool as_given = false;  // the mesh is the boundary of the solid
  try {
    std::optional<DistanceToMesh> thorough;
    if (effort == Effort::kThorough) {
      thorough.emplace(surface, grid, parallel, progress.part(0.1, 0.25));
      thorough->measure_near(grid, parallel);
    } else {
      measure_by_levels(NearestTriangle(surface), grid, parallel);
    }
    const WindingField winding(surface, tree, grid, parallel, progress.part(0.25, 0.5));
    const SolidBoundary boundary =
        solid_boundary(surface, grid, winding, topology.parts == 1, parallel, progress.part(0.5, 0.7));
    if (boundary.mesh.triangles.empty()) refuse_empty(report, spacing);
    as_given = report.closed && !boundary.differs;
    // Surfaces inside the solid and holes: distances to the boundary of the solid instead of those to the mesh.
    if (boundary.differs && thorough) {
      const auto same_part = [&](std::int32_t triangle, const Vec3d& X) {
        return boundary.triangle_at(surface, spacing, triangle, X);
      };
      thorough->replace_mesh(boundary.mesh, boundary.kept, same_part, parallel);
    } else if (boundary.differs) {
      measure_by_levels(NearestTriangle(boundary.mesh), grid, parallel);
    }
    if (thorough) thorough->measure(grid, parallel, progress.part(0.75, 1.0));
    caps = boundary.cap_triangles;
    report.inner_triangles = static_cast<std::uint32_t>(boundary.inner_triangles);
    apply_sign(winding.at_nodes(), grid);
    if (std::none_of(grid.values.begin(), grid.values.end(), [](float phi) { return phi < 0.0f; }))
      refuse_empty(report, spacing);
    if (effort == Effort::kThorough) report.separate_pieces = count_separate_pieces(surface, topology, grid);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorCode::kMemory, text("signed distance: not enough memory for ", grid.size[0], " x ", grid.size[1],
                                         " x ", grid.size[2], " nodes at spacing ", spacing, " m"));
  }
  // A closed mesh knows its volume better than the grid does.
  report.solid_volume = as_given ? signed_volume(mesh) : grid.volume();
  report.repairs = describe_repairs(report, turned, caps);
  report.repaired = !report.repairs.empty();
  progress.at(1.0);
  return grid;
}

std::shared_ptr<const Surface> examine(TriangleMesh mesh, double spacing, Effort effort, const Parallel& parallel,
                                       const Progress& progress) {
  auto surface = std::make_shared<Surface>();
  surface->mesh = std::move(mesh);
  surface->distance = build(surface->mesh, spacing, kDefaultMargin, effort, surface->report, parallel, progress);
  return surface;
}

}  // namespace

SignedDistance build_signed_distance(const TriangleMesh& mesh, double spacing, MeshReport& report,
                                     const Parallel& parallel, const Progress& progress, double margin) {
  TriangleMesh turned = mesh;
  return build(turned, spacing, margin, Effort::kThorough, report, parallel, progress);
}

std::shared_ptr<const Surface> examine(TriangleMesh mesh, double spacing, const Parallel& parallel,
                                       const Progress& progress) {
  return examine(std::move(mesh), spacing, Effort::kThorough, parallel, progress);
}

std::shared_ptr<const Surface> examine_moved(TriangleMesh mesh, double spacing, const Parallel& parallel) {
  return examine(std::move(mesh), spacing, Effort::kByLevels, parallel, Progress());
}

}  // namespace efsi::geometry
