// Purpose: the solid that a mesh stands for and its boundary.
#include "geometry/solid_boundary.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "geometry/kuhn.hpp"

namespace efsi::geometry {

namespace {

// A crossing of the level 1/2 with a smaller change of the winding number than this is a cap; the surface itself makes
// a jump of 1.
constexpr double kCapJump = 0.75;

// A node this close to the surface, in spacings, lies on it: its winding number is that of neither side.
constexpr double kOnSurface = 1e-3;

// Are both sides of the level 1/2 among the corners of the cell around X?
bool cell_is_cut(const SignedDistance& grid, const std::vector<float>& winding, const Vec3d& X) {
  std::array<int, 3> cell;
  for (int axis = 0; axis < 3; ++axis)
    cell[axis] =
        std::clamp(static_cast<int>(std::floor((X[axis] - grid.origin[axis]) / grid.spacing)), 0, grid.size[axis] - 2);
  int inside = 0;
  for (int c = 0; c < 8; ++c)
    inside += winding[grid.index(cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2 & 1))] > kInsideWinding;
  return inside != 0 && inside != 8;
}

void add_triangle(TriangleMesh& mesh, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const std::int32_t first = static_cast<std::int32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

// Adds what bounds the solid of one triangle; returns whether that is all of it.
template <class Bounds>
bool add_bounding_pieces(const std::array<Vec3d, 3>& t, double spacing, const Bounds& bounds, TriangleMesh& boundary) {
  const Vec3d e1 = t[1] - t[0], e2 = t[2] - t[0], twice_area = e1.cross(e2);
  if (twice_area.squaredNorm() == 0.0) return true;
  const Vec3d normal = twice_area.normalized();
  const double longest = std::sqrt(std::max({e1.squaredNorm(), e2.squaredNorm(), (t[2] - t[1]).squaredNorm()}));
  const int cuts = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
  const auto at = [&](int i, int j) -> Vec3d { return t[0] + (i * e1 + j * e2) / cuts; };
  const std::size_t points_before = boundary.points.size(), triangles_before = boundary.triangles.size();
  bool all = true;
  const auto piece = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    if (bounds((a + b + c) / 3.0, normal)) {
      add_triangle(boundary, a, b, c);
    } else {
      all = false;
    }
  };
  for (int i = 0; i < cuts; ++i) {
    for (int j = 0; i + j < cuts; ++j) {
      piece(at(i, j), at(i + 1, j), at(i, j + 1));
      if (i + j + 1 < cuts) piece(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  if (all) {  // whole again
    boundary.points.resize(points_before);
    boundary.triangles.resize(triangles_before);
    add_triangle(boundary, t[0], t[1], t[2]);
  }
  return all;
}

struct Corner {
  Vec3d X;
  double winding, distance;  // distance in spacings
};

bool is_inside(const Corner& corner) { return corner.winding > kInsideWinding; }

// Does the edge between two corners on different sides meet a cap rather than the surface?
bool crosses_cap(const Corner& p, const Corner& q) {
  return std::abs(q.winding - p.winding) < kCapJump && p.distance > kOnSurface && q.distance > kOnSurface;
}

// Where the edge between two corners on different sides meets the boundary.
Vec3d crossing(const Corner& p, const Corner& q) {
  const double jump = q.winding - p.winding, reach = p.distance + q.distance;
  double t = 0.5;
  if (crosses_cap(p, q)) {
    t = (kInsideWinding - p.winding) / jump;
  } else if (reach > 0.0) {
    t = p.distance / reach;
  }
  return p.X + t * (q.X - p.X);
}

// Adds the level 1/2 in a tetrahedron of which at least one edge crosses it away from the surface.
void add_cap(const std::array<Corner, 4>& corners, TriangleMesh& boundary, std::uint64_t& cap_triangles) {
  std::array<const Corner*, 4> in{}, out{};
  int ins = 0, outs = 0;
  for (const Corner& c : corners) (is_inside(c) ? in[ins++] : out[outs++]) = &c;
  bool cap = false;
  for (int i = 0; i < ins; ++i)
    for (int o = 0; o < outs; ++o) cap = cap || crosses_cap(*in[i], *out[o]);
  if (!cap) return;
  if (ins == 2) {
    const Vec3d a = crossing(*in[0], *out[0]), b = crossing(*in[0], *out[1]);
    const Vec3d c = crossing(*in[1], *out[1]), d = crossing(*in[1], *out[0]);
    add_triangle(boundary, a, b, c);
    add_triangle(boundary, a, c, d);
    cap_triangles += 2;
  } else {
    const Corner& tip = ins == 1 ? *in[0] : *out[0];
    const auto& others = ins == 1 ? out : in;
    add_triangle(boundary, crossing(tip, *others[0]), crossing(tip, *others[1]), crossing(tip, *others[2]));
    ++cap_triangles;
  }
}

void add_caps(const SignedDistance& distance, const std::vector<float>& winding, SolidBoundary& boundary) {
  for (int k = 0; k + 1 < distance.size[2]; ++k) {
    for (int j = 0; j + 1 < distance.size[1]; ++j) {
      for (int i = 0; i + 1 < distance.size[0]; ++i) {
        std::array<Corner, 8> corners;
        int inside = 0;
        for (int c = 0; c < 8; ++c) {
          const int x = i + (c & 1), y = j + (c >> 1 & 1), z = k + (c >> 2 & 1);
          const std::size_t at = distance.index(x, y, z);
          corners[c] = {distance.node(x, y, z), winding[at], distance.values[at] / distance.spacing};
          inside += is_inside(corners[c]);
        }
        if (inside == 0 || inside == 8) continue;
        for (const auto& t : kKuhnTetrahedra) {
          const std::array<Corner, 4> tetrahedron = {corners[t[0]], corners[t[1]], corners[t[2]], corners[t[3]]};
          const auto ins = std::count_if(tetrahedron.begin(), tetrahedron.end(), is_inside);
          if (ins != 0 && ins != 4) add_cap(tetrahedron, boundary.mesh, boundary.cap_triangles);
        }
      }
    }
  }
}

}  // namespace

std::vector<float> node_winding_numbers(const TriangleTree& tree, const SignedDistance& distance, bool balanced) {
  const std::size_t nodes = distance.values.size();
  std::vector<float> winding(nodes, 0.0f);
  // Two neighbouring nodes that are both farther than one spacing from the surface have none of it between them.
  const float close = balanced ? static_cast<float>(distance.spacing) : std::numeric_limits<float>::infinity();
  const std::size_t row = distance.size[0], slab = row * distance.size[1];
  std::vector<bool> known(nodes, false);
  std::vector<std::size_t> region;
  for (int k = 0; k < distance.size[2]; ++k) {
    for (int j = 0; j < distance.size[1]; ++j) {
      for (int i = 0; i < distance.size[0]; ++i) {
        const std::size_t at = distance.index(i, j, k);
        if (known[at]) continue;
        known[at] = true;
        winding[at] = static_cast<float>(tree.winding_number(distance.node(i, j, k)));
        if (distance.values[at] <= close) continue;
        region.assign(1, at);
        while (!region.empty()) {
          const std::size_t here = region.back();
          region.pop_back();
          const std::size_t x = here % row, y = here % slab / row, z = here / slab;
          const auto visit = [&](bool exists, std::size_t next) {
            if (!exists || known[next] || distance.values[next] <= close) return;
            known[next] = true;
            winding[next] = winding[at];
            region.push_back(next);
          };
          visit(x > 0, here - 1);
          visit(x + 1 < row, here + 1);
          visit(y > 0, here - row);
          visit(here % slab + row < slab, here + row);
          visit(z > 0, here - slab);
          visit(here + slab < nodes, here + slab);
        }
      }
    }
  }
  return winding;
}

SolidBoundary solid_boundary(const TriangleMesh& mesh, const TriangleTree& tree, const SignedDistance& distance,
                             const std::vector<float>& winding, bool balanced, bool trust_cells) {
  SolidBoundary boundary;
  const double step = 1e-3 * distance.spacing;
  const auto bounds = [&](const Vec3d& middle, const Vec3d& normal) {
    if (trust_cells && cell_is_cut(distance, winding, middle)) return true;
    const bool front = tree.winding_number(middle + step * normal) > kInsideWinding;
    const bool back = tree.winding_number(middle - step * normal) > kInsideWinding;
    return front != back;
  };
  for (const Triangle& t : mesh.triangles) {
    const std::array<Vec3d, 3> corners = {mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]]};
    if (!add_bounding_pieces(corners, distance.spacing, bounds, boundary.mesh)) boundary.differs = true;
  }
  if (!balanced) add_caps(distance, winding, boundary);
  boundary.differs = boundary.differs || boundary.cap_triangles > 0;
  return boundary;
}

}  // namespace efsi::geometry
