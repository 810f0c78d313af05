// Purpose: how the triangles of a mesh hang together: coincident points, edges, holes, parts, orientation.
#include "geometry/mesh_topology.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/triangle_tree.hpp"

namespace efsi::geometry {

namespace {

constexpr double kWeldTolerance = 1e-7;  // of the diagonal of the extents

// One side of one triangle: the edge {low, high}, run along from low to high or back.
struct HalfEdge {
  std::int32_t low, high, triangle;
  bool forward;
};

std::vector<HalfEdge> sorted_half_edges(const TriangleMesh& mesh) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    for (int side = 0; side < 3; ++side) {
      const std::int32_t from = t[side], to = t[(side + 1) % 3];
      edges.push_back({std::min(from, to), std::max(from, to), static_cast<std::int32_t>(i), from < to});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    if (a.low != b.low) return a.low < b.low;
    if (a.high != b.high) return a.high < b.high;
    return a.triangle < b.triangle;
  });
  return edges;
}

// Calls visit(begin, end) for the half-edges of each edge.
template <class Visit>
void for_each_edge(const std::vector<HalfEdge>& edges, const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && edges[end].low == edges[begin].low && edges[end].high == edges[begin].high) ++end;
    visit(begin, end);
  }
}

std::int32_t root_of(std::vector<std::int32_t>& parent, std::int32_t item) {
  while (parent[item] != item) item = parent[item] = parent[parent[item]];
  return item;
}

void join(std::vector<std::int32_t>& parent, std::int32_t a, std::int32_t b) {
  a = root_of(parent, a);
  b = root_of(parent, b);
  parent[std::max(a, b)] = std::min(a, b);
}

// Open edges form closed loops; where loops touch in a point the shortest way back closes one.
void trace_holes(const TriangleMesh& mesh, const std::vector<std::array<std::int32_t, 2>>& open, Topology& topology) {
  struct Side {
    std::int32_t from, to;
    std::size_t edge;
  };
  std::vector<Side> sides;
  for (std::size_t e = 0; e < open.size(); ++e) {
    sides.push_back({open[e][0], open[e][1], e});
    sides.push_back({open[e][1], open[e][0], e});
  }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return a.from != b.from ? a.from < b.from : a.edge < b.edge; });
  std::vector<bool> used(open.size(), false);
  std::vector<std::size_t> path;                              // indices of sides walked and not yet closed
  std::vector<std::ptrdiff_t> place(mesh.points.size(), -1);  // of the side on the path that leaves a point, -1: none
  const auto next_side = [&](std::int32_t point) {
    auto side = std::lower_bound(sides.begin(), sides.end(), point,
                                 [](const Side& s, std::int32_t value) { return s.from < value; });
    while (side != sides.end() && side->from == point && used[side->edge]) ++side;
    return side != sides.end() && side->from == point ? static_cast<std::size_t>(side - sides.begin()) : sides.size();
  };
  for (std::size_t start = 0; start < sides.size(); ++start) {
    for (const std::size_t side : path) place[sides[side].from] = -1;
    path.clear();
    std::int32_t point = sides[start].from;
    for (std::size_t side = next_side(point); side != sides.size(); side = next_side(point)) {
      used[sides[side].edge] = true;
      place[point] = static_cast<std::ptrdiff_t>(path.size());
      path.push_back(side);
      point = sides[side].to;
      if (place[point] < 0) continue;
      const auto begin = path.begin() + place[point];
      double length = 0.0;
      for (auto s = begin; s != path.end(); ++s) {
        length += (mesh.points[sides[*s].to] - mesh.points[sides[*s].from]).norm();
        place[sides[*s].from] = -1;
      }
      path.erase(begin, path.end());
      ++topology.holes;
      topology.largest_hole = std::max(topology.largest_hole, length);
    }
  }
}

// Fills the loop first..last of points, whose edges run from each to the next and from the last to the first.
void fill_loop(const std::vector<std::int32_t>& points, std::size_t first, std::size_t last,
               std::vector<Triangle>& triangles) {
  if (last - first < 2) return;
  const std::size_t middle = first + (last - first) / 2;
  triangles.push_back({points[first], points[middle], points[last]});
  fill_loop(points, first, middle, triangles);
  fill_loop(points, middle, last, triangles);
}

// Turns triangles until the two sides of every manifold edge run in opposite directions, where that is possible; in
// each connected patch the smaller number of triangles is turned.
std::uint64_t agree_with_neighbours(TriangleMesh& mesh) {
  struct Link {
    std::int32_t from, to;
    bool agree;
  };
  // Pairs of triangles that share an edge, and whether they agree.
  std::vector<Link> links;
  const std::vector<HalfEdge> edges = sorted_half_edges(mesh);
  for_each_edge(edges, [&](std::size_t begin, std::size_t end) {
    if (end - begin != 2) return;
    const HalfEdge &a = edges[begin], &b = edges[begin + 1];
    links.push_back({a.triangle, b.triangle, a.forward != b.forward});
    links.push_back({b.triangle, a.triangle, a.forward != b.forward});
  });
  std::stable_sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.from < b.from; });
  std::vector<std::size_t> first(mesh.triangles.size() + 1, 0);
  for (const Link& link : links) ++first[link.from + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());

  // Each connected patch: the minority is reversed.
  std::uint64_t turned = 0;
  std::vector<signed char> side(mesh.triangles.size(), 0);  // +1 as given, -1 turned
  std::vector<std::int32_t> patch;
  for (std::size_t seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (side[seed] != 0) continue;
    side[seed] = 1;
    patch.assign(1, static_cast<std::int32_t>(seed));
    std::size_t minus = 0;
    for (std::size_t head = 0; head < patch.size(); ++head) {
      const std::int32_t t = patch[head];
      for (std::size_t l = first[t]; l < first[t + 1]; ++l) {
        if (side[links[l].to] != 0) continue;
        side[links[l].to] = static_cast<signed char>(links[l].agree ? side[t] : -side[t]);
        minus += side[links[l].to] < 0;
        patch.push_back(links[l].to);
      }
    }
    const signed char turn = minus * 2 > patch.size() ? 1 : -1;
    for (const std::int32_t t : patch) {
      if (side[t] != turn) continue;
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
      ++turned;
    }
  }
  return turned;
}

// Points that triangles use.
std::size_t count_used(const TriangleMesh& mesh) {
  std::vector<bool> used(mesh.points.size(), false);
  for (const Triangle& t : mesh.triangles)
    for (const std::int32_t corner : t) used[corner] = true;
  return static_cast<std::size_t>(std::count(used.begin(), used.end(), true));
}

}  // namespace

std::vector<std::int32_t> weld_points(const TriangleMesh& mesh) {
  const std::size_t n = mesh.points.size();
  std::vector<std::int32_t> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  if (mesh.triangles.empty()) return parent;
  const Extents box = extents(mesh);
  const double tolerance = kWeldTolerance * (box.max - box.min).norm();
  // Points that coincide are neighbours in the order along any direction; a skew one keeps the points of an
  // axis-aligned plane apart.
  const Vec3d direction = Vec3d(0.7548776662, 0.5698402910, 0.3247179572).normalized();
  std::vector<std::pair<double, std::int32_t>> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = {mesh.points[i].dot(direction), static_cast<std::int32_t>(i)};
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n && order[j].first - order[i].first <= tolerance; ++j) {
      if ((mesh.points[order[j].second] - mesh.points[order[i].second]).squaredNorm() <= tolerance * tolerance)
        join(parent, order[i].second, order[j].second);
    }
  }
  for (std::size_t i = 0; i < n; ++i) parent[i] = root_of(parent, static_cast<std::int32_t>(i));
  return parent;
}

TriangleMesh weld(const TriangleMesh& mesh, std::vector<std::int32_t>* kept) {
  const std::vector<std::int32_t> lowest = weld_points(mesh);
  TriangleMesh welded;
  welded.points = mesh.points;
  welded.triangles.reserve(mesh.triangles.size());
  if (kept) kept->clear();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const Triangle joined = {lowest[t[0]], lowest[t[1]], lowest[t[2]]};
    if (joined[0] == joined[1] || joined[1] == joined[2] || joined[2] == joined[0]) continue;
    welded.triangles.push_back(joined);
    if (kept) kept->push_back(static_cast<std::int32_t>(i));
  }
  return welded;
}

Topology analyse_topology(const TriangleMesh& welded) {
  Topology topology;
  const std::size_t n = welded.triangles.size();
  std::vector<std::int32_t> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  std::vector<std::array<std::int32_t, 2>> open;
  std::vector<bool> broken(n, false);  // has an edge that a closed oriented surface does not have
  const std::vector<HalfEdge> edges = sorted_half_edges(welded);
  for_each_edge(edges, [&](std::size_t begin, std::size_t end) {
    const std::size_t faces = end - begin;
    const auto forward = std::count_if(edges.begin() + static_cast<std::ptrdiff_t>(begin),
                                       edges.begin() + static_cast<std::ptrdiff_t>(end),
                                       [](const HalfEdge& edge) { return edge.forward; });
    if (2 * static_cast<std::size_t>(forward) != faces) ++topology.unbalanced_edges;
    for (std::size_t e = begin + 1; e < end; ++e) join(parent, edges[begin].triangle, edges[e].triangle);
    if (faces == 1) open.push_back({edges[begin].low, edges[begin].high});
    if (faces > 2) ++topology.nonmanifold_edges;
    const bool inconsistent = faces == 2 && edges[begin].forward == edges[begin + 1].forward;
    if (inconsistent) ++topology.inconsistent_edges;
    if (faces != 2 || inconsistent) broken[edges[begin].triangle] = true;
  });
  topology.open_edges = open.size();
  trace_holes(welded, open, topology);

  topology.part.resize(n);
  std::vector<std::int32_t> number(n, -1);
  for (std::size_t i = 0; i < n; ++i) {
    std::int32_t& part = number[root_of(parent, static_cast<std::int32_t>(i))];
    if (part < 0) part = topology.parts++;
    topology.part[i] = part;
  }
  topology.part_closed.assign(topology.parts, true);
  for (std::size_t i = 0; i < n; ++i)
    if (broken[i]) topology.part_closed[topology.part[i]] = false;
  return topology;
}

std::vector<Triangle> closing_triangles(const TriangleMesh& welded) {
  std::vector<std::array<std::int32_t, 2>> missing;  // edges in the direction that the closing triangles run along
  const std::vector<HalfEdge> edges = sorted_half_edges(welded);
  for_each_edge(edges, [&](std::size_t begin, std::size_t end) {
    std::ptrdiff_t surplus = 0;
    for (std::size_t e = begin; e < end; ++e) surplus += edges[e].forward ? 1 : -1;
    const std::int32_t low = edges[begin].low, high = edges[begin].high;
    missing.insert(missing.end(), static_cast<std::size_t>(std::abs(surplus)),
                   surplus > 0 ? std::array{high, low} : std::array{low, high});
  });
  // As many missing edges end at a point as begin there: every walk comes back.
  std::sort(missing.begin(), missing.end());
  std::vector<std::size_t> next(welded.points.size() + 1, 0);  // per point, its first edge not yet walked
  for (const auto& edge : missing) ++next[edge[0] + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  const std::vector<std::size_t> first = next;
  std::vector<std::int32_t> path, loop, place(welded.points.size(), -1);  // place on the path, -1: not there
  std::vector<Triangle> triangles;
  for (const auto& start : missing) {
    std::int32_t point = start[0];
    while (next[point] < first[point + 1]) {
      place[point] = static_cast<std::int32_t>(path.size());
      path.push_back(point);
      point = missing[next[point]++][1];
      if (place[point] < 0) continue;
      loop.assign(path.begin() + place[point], path.end());
      for (const std::int32_t p : loop) place[p] = -1;
      path.resize(path.size() - loop.size());
      fill_loop(loop, 0, loop.size() - 1, triangles);
    }
  }
  return triangles;
}

namespace {

OrientationRepair turn_outwards(TriangleMesh& welded) {
  OrientationRepair repair;
  repair.reversed_triangles = agree_with_neighbours(welded);
  if (signed_volume(welded) < 0.0) {
    for (Triangle& t : welded.triangles) std::swap(t[1], t[2]);
    repair.turned_mesh = true;
  }
  const Topology topology = analyse_topology(welded);
  if (topology.parts < 2) return repair;

  // A closed part with negative volume is the wall of a cavity when its inner side lies outside the solid (w = 0), and
  // inside out when the winding number there is -1. The test point sits below the largest triangle.
  std::vector<double> volume(topology.parts, 0.0), largest(topology.parts, -1.0);
  std::vector<std::size_t> widest(topology.parts, 0);
  const Vec3d origin = welded.points[welded.triangles[0][0]];
  for (std::size_t i = 0; i < welded.triangles.size(); ++i) {
    const Triangle& t = welded.triangles[i];
    const Vec3d a = welded.points[t[0]] - origin, b = welded.points[t[1]] - origin, c = welded.points[t[2]] - origin;
    const std::int32_t part = topology.part[i];
    const double area = 0.5 * (b - a).cross(c - a).norm();
    volume[part] += a.dot(b.cross(c)) / 6.0;
    if (area > largest[part]) {
      largest[part] = area;
      widest[part] = i;
    }
  }
  const TriangleTree tree(welded);
  std::vector<bool> turn(topology.parts, false);
  for (std::int32_t part = 0; part < topology.parts; ++part) {
    if (!topology.part_closed[part] || volume[part] >= 0.0) continue;
    const Triangle& t = welded.triangles[widest[part]];
    const Vec3d &a = welded.points[t[0]], &b = welded.points[t[1]], &c = welded.points[t[2]];
    const Vec3d outer = (b - a).cross(c - a);  // points into the part, which is inside out
    const Vec3d inside = (a + b + c) / 3.0 + 1e-3 * std::sqrt(largest[part]) * outer.normalized();
    turn[part] = tree.winding_number(inside) < -0.5;
    repair.turned_parts += turn[part];
  }
  if (repair.turned_parts > 0) {
    for (std::size_t i = 0; i < welded.triangles.size(); ++i)
      if (turn[topology.part[i]]) std::swap(welded.triangles[i][1], welded.triangles[i][2]);
  }
  return repair;
}

}  // namespace

OrientationRepair orient_outwards(TriangleMesh& welded) {
  const std::vector<Triangle> before = welded.triangles;
  OrientationRepair repair = turn_outwards(welded);
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i] != welded.triangles[i]) repair.changed.push_back(i);
  return repair;
}

std::uint32_t count_separate_pieces(const TriangleMesh& welded, const Topology& topology, const SignedDistance& phi) {
  if (topology.parts < 2) return 1;
  // Nodes inside hang together along the lines of the grid, parts by the nodes beside their points.
  std::vector<std::int32_t> body(phi.values.size());
  std::iota(body.begin(), body.end(), 0);
  const std::array<std::size_t, 3> stride = {phi.index(1, 0, 0), phi.index(0, 1, 0), phi.index(0, 0, 1)};
  const auto inside = [&](std::size_t node) { return phi.values[node] < 0.0f; };
  for (int k = 0; k < phi.size[2]; ++k)
    for (int j = 0; j < phi.size[1]; ++j)
      for (int i = 0; i < phi.size[0]; ++i) {
        const std::size_t node = phi.index(i, j, k);
        const std::array<bool, 3> last = {i + 1 == phi.size[0], j + 1 == phi.size[1], k + 1 == phi.size[2]};
        for (std::size_t a = 0; a < 3; ++a)
          if (inside(node) && !last[a] && inside(node + stride[a]))
            join(body, static_cast<std::int32_t>(node), static_cast<std::int32_t>(node + stride[a]));
      }
  std::vector<std::int32_t> beside(static_cast<std::size_t>(topology.parts), -1);  // per part, one node; -1: none
  for (std::size_t i = 0; i < welded.triangles.size(); ++i)
    for (const std::int32_t corner : welded.triangles[i]) {
      const Vec3d cell = (welded.points[corner] - phi.origin) / phi.spacing;
      Vec3i low, high;  // a point that lies on a node has the inner ones among its neighbours
      for (std::size_t a = 0; a < 3; ++a) {
        const int nearest = static_cast<int>(std::lround(cell[static_cast<int>(a)]));
        low[a] = std::clamp(nearest - 1, 0, phi.size[a] - 1);
        high[a] = std::clamp(nearest + 1, 0, phi.size[a] - 1);
      }
      for (int k = low[2]; k <= high[2]; ++k)
        for (int j = low[1]; j <= high[1]; ++j)
          for (int n = low[0]; n <= high[0]; ++n) {
            const std::size_t node = phi.index(n, j, k);
            if (!inside(node)) continue;
            std::int32_t& other = beside[static_cast<std::size_t>(topology.part[i])];
            if (other < 0) other = static_cast<std::int32_t>(node);
            join(body, other, static_cast<std::int32_t>(node));
          }
    }
  std::vector<std::int32_t> found;
  for (const std::int32_t node : beside)
    if (node >= 0) found.push_back(root_of(body, node));
  std::sort(found.begin(), found.end());
  return static_cast<std::uint32_t>(std::unique(found.begin(), found.end()) - found.begin());
}

MeshReport inspect(const TriangleMesh& mesh) {
  MeshReport report;
  report.triangles = mesh.triangles.size();
  if (mesh.triangles.empty()) return report;
  const Extents box = extents(mesh);
  const TriangleMesh welded = weld(mesh);
  const Topology topology = analyse_topology(welded);
  report.merged_points = static_cast<std::uint32_t>(count_used(mesh) - count_used(welded));
  report.surface_volume = signed_volume(mesh);
  report.extent_min = box.min;
  report.extent_max = box.max;
  report.open_edges = topology.open_edges;
  report.holes = topology.holes;
  report.largest_hole = topology.largest_hole;
  report.nonmanifold_edges = topology.nonmanifold_edges;
  report.closed = topology.closed();
  return report;
}

}  // namespace efsi::geometry
