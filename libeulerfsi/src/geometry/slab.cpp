#include "geometry/slab.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "geometry/mesh_topology.hpp"
#include "geometry/solid_boundary.hpp"
#include "geometry/thickness.hpp"

namespace efsi::geometry {

namespace {

constexpr double kInset = 0.01;  // of the thickness: points on the faces lie in the slab to the last bit
constexpr double kReach = 1e-5;  // of the thickness: a mesh that ends on a face reaches through

double cross(const Point2& a, const Point2& b) { return a[0] * b[1] - a[1] * b[0]; }

// Turns of a closed section around x: what crosses the ray from x along the first axis.
int winding(const Section& section, const Point2& x) {
  int turns = 0;
  for (const auto& [from, to] : section.segments) {
    const bool starts_above = from[1] > x[1], ends_above = to[1] > x[1];
    if (starts_above == ends_above || (cross(to - from, x - from) > 0.0) != ends_above) continue;
    turns += ends_above ? 1 : -1;
  }
  return turns;
}

double distance_to(const std::array<Point2, 2>& segment, const Point2& x) {
  const Point2 along = segment[1] - segment[0], from = x - segment[0];
  const double square = along.squaredNorm();
  const double t = square > 0.0 ? std::clamp(from.dot(along) / square, 0.0, 1.0) : 0.0;
  return (from - t * along).norm();
}

// Left normal of a segment: into the solid.
Point2 inwards(const std::array<Point2, 2>& s) {
  const Point2 along = (s[1] - s[0]).normalized();
  return {-along[1], along[0]};
}

// What bounds the solid: segments with solid on one side only.
Section boundary(const Parallel& parallel, const Section& section, double spacing) {
  const double step = 1e-4 * spacing;
  std::vector<std::uint8_t> keep(section.segments.size());
  parallel.for_each(static_cast<std::int64_t>(keep.size()), [&](std::int64_t i) {
    const auto& s = section.segments[static_cast<std::size_t>(i)];
    const Point2 middle = 0.5 * (s[0] + s[1]), normal = step * inwards(s);
    keep[static_cast<std::size_t>(i)] =
        (winding(section, middle + normal) > kInsideWinding) != (winding(section, middle - normal) > kInsideWinding);
  });
  Section out;
  for (std::size_t i = 0; i < keep.size(); ++i)
    if (keep[i]) out.segments.push_back(section.segments[i]);
  return out;
}

double enclosed_area(const Section& section) {
  double sum = 0.0;
  for (const auto& [a, b] : section.segments) sum += 0.5 * cross(a, b);
  return sum;
}

// The first percentile of the lengths of rays through the section, as thinnest_feature() has them in space.
double thinnest(const Parallel& parallel, const Section& section, double spacing) {
  std::vector<double> up_to;
  double length = 0.0;
  for (const auto& [a, b] : section.segments) up_to.push_back(length += (b - a).norm());
  const auto rays = std::min<std::size_t>(kRays, 4 * section.segments.size());
  std::vector<double> lengths(rays, 0.0);
  parallel.for_each(static_cast<std::int64_t>(rays), [&](std::int64_t r) {
    const double at = length * (static_cast<double>(r) + 0.5) / static_cast<double>(rays);
    const auto found = std::upper_bound(up_to.begin(), up_to.end(), at);
    if (found == up_to.end()) return;
    const auto& s = section.segments[static_cast<std::size_t>(found - up_to.begin())];
    const double left = *found - at, whole = (s[1] - s[0]).norm();
    const Point2 start = s[1] - (whole > 0.0 ? left / whole : 0.0) * (s[1] - s[0]), way = inwards(s);
    double nearest = std::numeric_limits<double>::infinity(), cosine = 0.0;
    for (const auto& other : section.segments) {
      const Point2 along = other[1] - other[0];
      const double facing = cross(way, along);
      if (facing == 0.0) continue;
      const double t = cross(other[0] - start, along) / facing, q = cross(other[0] - start, way) / facing;
      if (t <= 1e-6 * spacing || t >= nearest || q < 0.0 || q > 1.0) continue;
      nearest = t;
      cosine = -way.dot(inwards(other));
    }
    if (cosine > kFacingCosine) lengths[static_cast<std::size_t>(r)] = nearest;
  });
  std::erase(lengths, 0.0);
  if (lengths.empty()) return 0.0;
  const auto chosen = lengths.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(lengths.size()));
  std::nth_element(lengths.begin(), chosen, lengths.end());
  return *chosen;
}

// Nodes over the section and a margin around it; along the slab's axis from face to face, at least two.
SignedDistance make_grid(const Section& section, const Slab& slab, double spacing) {
  Point2 low = Point2::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const auto& segment : section.segments)
    for (const Point2& p : segment) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  SignedDistance grid;
  grid.spacing = spacing;
  grid.flat = slab.axis;
  for (int c = 0; c < 2; ++c) {
    const int axis = (slab.axis + 1 + c) % 3;
    const double cells = (high[c] - low[c]) / spacing + 2.0 * kDefaultMargin;
    grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(std::ceil(cells - 1e-5)) + 1;
    const double more = grid.size[static_cast<std::size_t>(axis)] - 1 - cells;
    grid.origin[axis] = low[c] - (kDefaultMargin + 0.5 * more) * spacing;
  }
  grid.size[static_cast<std::size_t>(slab.axis)] =
      std::max(2, static_cast<int>(std::lround(slab.thickness() / spacing)) + 1);
  grid.origin[slab.axis] = slab.low;
  std::size_t nodes = 1;
  for (const int n : grid.size) nodes *= static_cast<std::size_t>(n);
  grid.values.resize(nodes);
  return grid;
}

// Calls body(place in the plane) for the nodes of the first layer and gives all layers its value.
template <class Body>
void fill_layers(const Parallel& parallel, int axis, SignedDistance& grid, const Body& body) {
  const auto a = static_cast<std::size_t>(axis), u = (a + 1) % 3, v = (a + 2) % 3;
  parallel.for_each(grid.size[v], [&](std::int64_t q) {
    Vec3i at{};
    at[v] = static_cast<int>(q);
    for (int p = 0; p < grid.size[u]; ++p) {
      at[u] = p;
      at[a] = 0;
      const float value = body(grid.node(at[0], at[1], at[2]));
      for (; at[a] < grid.size[a]; ++at[a]) grid.values[grid.index(at[0], at[1], at[2])] = value;
    }
  });
}

void demand_through(const MeshReport& report, const Slab& slab) {
  const double low = report.extent_min[slab.axis], high = report.extent_max[slab.axis];
  const double rounding = kReach * slab.thickness();
  if (low <= slab.low + rounding && high >= slab.high - rounding) return;
  std::ostringstream text;
  text << "extends from " << low << " to " << high << " in "
       << "xyz"[slab.axis] << ": must reach through the slab, " << slab.low << " to " << slab.high;
  refuse_mesh(text.str());
}

}  // namespace

Section cut(const TriangleMesh& mesh, int axis, double place) {
  const TriangleMesh surface = weld(mesh);
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto above = [&](std::int32_t point) { return surface.points[static_cast<std::size_t>(point)][axis] >= place; };
  // The same point for both triangles of an edge.
  const auto crossing = [&](std::int32_t from, std::int32_t to) {
    const Vec3d &a = surface.points[static_cast<std::size_t>(std::min(from, to))],
                &b = surface.points[static_cast<std::size_t>(std::max(from, to))];
    const double t = (place - a[axis]) / (b[axis] - a[axis]);
    return Point2(a[u] + t * (b[u] - a[u]), a[v] + t * (b[v] - a[v]));
  };
  Section section;
  std::map<std::pair<std::int32_t, std::int32_t>, int> ends;
  for (const Triangle& t : surface.triangles) {
    Point2 up = Point2::Zero(), down = Point2::Zero();
    int count = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const std::int32_t from = t[side], to = t[(side + 1) % 3];
      if (above(from) == above(to)) continue;
      ++count;
      const auto edge = std::minmax(from, to);
      ends[{edge.first, edge.second}] += above(to) ? 1 : -1;
      (above(to) ? up : down) = crossing(from, to);
    }
    // Seen from outside the triangle runs up on its right: along the section that is from where it goes down.
    if (count == 2 && up != down) section.segments.push_back({down, up});
  }
  for (const auto& [edge, sum] : ends) section.open_ends += sum != 0;
  return section;
}

std::shared_ptr<const Surface> extrude_in_slab(const Surface& surface, const Slab& slab, const Parallel& parallel) {
  demand_through(surface.report, slab);
  auto out = std::make_shared<Surface>();
  out->report = surface.report;
  out->mesh = surface.mesh;
  // Vertices beyond the slab are placed on its faces.
  const double inset = kInset * slab.thickness();
  for (Vec3d& x : out->mesh.points) {
    out->along.push_back(x[slab.axis]);
    x[slab.axis] = std::clamp(x[slab.axis], slab.low + inset, slab.high - inset);
  }
  // The section halfway.
  const double spacing = surface.distance.spacing;
  const Section whole = cut(surface.mesh, slab.axis, slab.middle());
  if (whole.open_ends > 0)
    refuse_mesh("its section through the slab has " + std::to_string(static_cast<int>(whole.open_ends)) +
                " open ends: must be closed");
  const Section section = boundary(parallel, whole, spacing);
  if (section.segments.empty()) refuse_mesh("its section through the slab encloses nothing");
  // Signed distances in the plane.
  SignedDistance& distance = out->distance = make_grid(section, slab, spacing);
  const int u = (slab.axis + 1) % 3, v = (slab.axis + 2) % 3;
  const double on_surface = 1e-5 * spacing;
  fill_layers(parallel, slab.axis, distance, [&](const Vec3d& node) {
    const Point2 x(node[u], node[v]);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& segment : section.segments) least = std::min(least, distance_to(segment, x));
    return static_cast<float>(least < on_surface ? 0.0 : winding(whole, x) > kInsideWinding ? -least : least);
  });
  if (std::none_of(distance.values.begin(), distance.values.end(), [](float phi) { return phi < 0.0f; }))
    refuse_mesh("its section through the slab encloses no node of the grid at spacing " + std::to_string(spacing) +
                " m");
  // The report of the slab.
  MeshReport& report = out->report;
  report.extent_min[slab.axis] = slab.low;
  report.extent_max[slab.axis] = slab.high;
  for (int c = 0; c < 2; ++c) {
    const int axis = (slab.axis + 1 + c) % 3;
    report.extent_min[axis] = std::numeric_limits<double>::infinity();
    report.extent_max[axis] = -report.extent_min[axis];
    for (const auto& segment : section.segments)
      for (const Point2& p : segment) {
        report.extent_min[axis] = std::min(report.extent_min[axis], p[c]);
        report.extent_max[axis] = std::max(report.extent_max[axis], p[c]);
      }
  }
  report.solid_volume = slab.thickness() * std::abs(enclosed_area(section));
  report.thinnest_feature = thinnest(parallel, section, spacing);
  return out;
}

SignedDistance flattened(const SignedDistance& field, const Slab& slab) {
  SignedDistance out = field;
  out.flat = slab.axis;
  const auto a = static_cast<std::size_t>(slab.axis);
  out.size[a] = 2;
  out.origin[slab.axis] = slab.low;
  std::size_t nodes = 1;
  for (const int n : out.size) nodes *= static_cast<std::size_t>(n);
  out.values.resize(nodes);
  fill_layers(Parallel(), slab.axis, out, [&](Vec3d node) {
    node[slab.axis] = slab.middle();
    return static_cast<float>(field.sample(node));
  });
  return out;
}

}  // namespace efsi::geometry
