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

// The smooth part of the winding number changes by less than this from the front of a triangle to close behind it,
// unless an open edge is as near.
constexpr double kDoubt = 0.05;

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

// A triangle cut to pieces of about one spacing, all alike.
struct Cut {
  Cut(const TriangleMesh& mesh, const Triangle& t, double spacing)
      : a(mesh.points[t[0]]), e1(mesh.points[t[1]] - a), e2(mesh.points[t[2]] - a) {
    const Vec3d e3 = mesh.points[t[2]] - mesh.points[t[1]], twice_area = e1.cross(e2);
    normal = twice_area.normalized();
    const double longest = std::sqrt(std::max({e1.squaredNorm(), e2.squaredNorm(), e3.squaredNorm()}));
    cuts = twice_area.squaredNorm() == 0.0 ? 0 : std::max(1, static_cast<int>(std::ceil(longest / spacing)));
  }

  std::size_t pieces() const { return static_cast<std::size_t>(cuts) * cuts; }
  Vec3d at(int i, int j) const { return a + (i * e1 + j * e2) / cuts; }

  // The number of the piece at the point X of the triangle, in the order of for_each().
  std::size_t piece_at(const Vec3d& X) const {
    const Vec3d x = X - a;
    const double aa = e1.dot(e1), ab = e1.dot(e2), bb = e2.dot(e2), determinant = aa * bb - ab * ab;
    const double u = cuts * (bb * e1.dot(x) - ab * e2.dot(x)) / determinant;
    const double v = cuts * (aa * e2.dot(x) - ab * e1.dot(x)) / determinant;
    const int i = std::clamp(static_cast<int>(u), 0, cuts - 1), j = std::clamp(static_cast<int>(v), 0, cuts - 1 - i);
    const bool upper = u - i + v - j > 1.0 && i + j + 1 < cuts;
    return static_cast<std::size_t>(i) * (2 * cuts - i) + 2 * j + upper;
  }

  // Calls visit(corner, corner, corner) for each piece.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (int i = 0; i < cuts; ++i) {
      for (int j = 0; i + j < cuts; ++j) {
        visit(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < cuts) visit(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
    }
  }

  Vec3d a, e1, e2, normal;
  int cuts;  // along an edge; 0: the triangle has no area
};

// Winding numbers at points close behind those in front: the same but for the jump, taken anew where that leaves doubt
// on which side of 1/2 they are.
std::vector<float> numbers_behind(const WindingField& winding, const std::vector<Vec3d>& front,
                                  const std::vector<float>& in_front, const std::vector<Vec3d>& behind,
                                  const Parallel& parallel, const Progress& progress) {
  std::vector<float> numbers(behind.size());
  parallel.for_each(static_cast<std::int64_t>(behind.size()), [&](std::int64_t i) {
    numbers[i] = in_front[i] + static_cast<float>(winding.jump(front[i], behind[i]));
  });
  std::vector<std::size_t> doubtful;
  std::vector<Vec3d> points;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (std::abs(numbers[i] - kInsideWinding) >= kDoubt) continue;
    doubtful.push_back(i);
    points.push_back(behind[i]);
  }
  const std::vector<float> anew = winding.at(points, parallel, progress);
  for (std::size_t i = 0; i < doubtful.size(); ++i) numbers[doubtful[i]] = anew[i];
  return numbers;
}

// For every piece of every triangle whether it bounds the solid: the winding number passes 1/2 across it.
std::vector<char> bounding_pieces(const TriangleMesh& mesh, const std::vector<std::size_t>& first_piece,
                                  const SignedDistance& distance, const WindingField& winding, bool trust_cells,
                                  const Parallel& parallel, const Progress& progress) {
  const double step = 1e-3 * distance.spacing;
  const auto triangles = static_cast<std::int64_t>(mesh.triangles.size());
  std::vector<char> bounds(first_piece.back(), 0);
  std::vector<Vec3d> middles(bounds.size());
  parallel.for_each(triangles, [&](std::int64_t t) {
    std::size_t piece = first_piece[t];
    Cut(mesh, mesh.triangles[t], distance.spacing).for_each([&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
      middles[piece] = (a + b + c) / 3.0;
      bounds[piece] = trust_cells && cell_is_cut(distance, winding.at_nodes(), middles[piece]);
      ++piece;
    });
  });
  std::vector<std::size_t> open;     // pieces that need a test
  std::vector<Vec3d> front, behind;  // of each
  for (std::size_t t = 0; t + 1 < first_piece.size(); ++t) {
    const Vec3d offset = step * Cut(mesh, mesh.triangles[t], distance.spacing).normal;
    for (std::size_t piece = first_piece[t]; piece < first_piece[t + 1]; ++piece) {
      if (bounds[piece]) continue;
      open.push_back(piece);
      front.push_back(middles[piece] + offset);
      behind.push_back(middles[piece] - offset);
    }
  }
  const std::vector<float> in_front = winding.at(front, parallel, progress.part(0.0, 0.8));
  const std::vector<float> numbers =
      numbers_behind(winding, front, in_front, behind, parallel, progress.part(0.8, 1.0));
  for (std::size_t i = 0; i < open.size(); ++i)
    bounds[open[i]] = (in_front[i] > kInsideWinding) != (numbers[i] > kInsideWinding);
  return bounds;
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

// Caps of the cells between two slabs of nodes.
void add_caps(const SignedDistance& distance, const std::vector<float>& winding, int k, SolidBoundary& boundary) {
  for (int j = 0; j + 1 < distance.size[1]; ++j) {
    for (int i = 0; i + 1 < distance.size[0]; ++i) {
      std::array<Corner, 8> corners;
      int inside = 0;
      for (int c = 0; c < 8; ++c)
        inside += winding[distance.index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1))] > kInsideWinding;
      if (inside == 0 || inside == 8) continue;
      for (int c = 0; c < 8; ++c) {
        const int x = i + (c & 1), y = j + (c >> 1 & 1), z = k + (c >> 2 & 1);
        const std::size_t at = distance.index(x, y, z);
        corners[c] = {distance.node(x, y, z), winding[at], distance.values[at] / distance.spacing};
      }
      for (const auto& t : kKuhnTetrahedra) {
        const std::array<Corner, 4> tetrahedron = {corners[t[0]], corners[t[1]], corners[t[2]], corners[t[3]]};
        const auto ins = std::count_if(tetrahedron.begin(), tetrahedron.end(), is_inside);
        if (ins != 0 && ins != 4) add_cap(tetrahedron, boundary.mesh, boundary.cap_triangles);
      }
    }
  }
}

}  // namespace

SolidBoundary solid_boundary(const TriangleMesh& mesh, const SignedDistance& distance, const WindingField& winding,
                             bool trust_cells, const Parallel& parallel, const Progress& progress) {
  // Which pieces of the triangles bound the solid.
  std::vector<std::size_t> first_piece = {0};
  for (const Triangle& t : mesh.triangles)
    first_piece.push_back(first_piece.back() + Cut(mesh, t, distance.spacing).pieces());
  const std::vector<char> bounds =
      bounding_pieces(mesh, first_piece, distance, winding, trust_cells, parallel, progress);
  SolidBoundary boundary;
  boundary.triangle_of_piece.assign(bounds.size(), -1);
  const auto add = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    add_triangle(boundary.mesh, a, b, c);
    return static_cast<std::int32_t>(boundary.mesh.triangles.size()) - 1;
  };
  // Whole triangles, and the bounding pieces of the others.
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto begin = bounds.begin() + static_cast<std::ptrdiff_t>(first_piece[t]);
    const auto end = bounds.begin() + static_cast<std::ptrdiff_t>(first_piece[t + 1]);
    if (begin == end) continue;
    auto number = boundary.triangle_of_piece.begin() + static_cast<std::ptrdiff_t>(first_piece[t]);
    if (std::find(begin, end, 0) == end) {  // whole
      const Triangle& corner = mesh.triangles[t];
      std::fill_n(number, end - begin, add(mesh.points[corner[0]], mesh.points[corner[1]], mesh.points[corner[2]]));
      continue;
    }
    ++boundary.inner_triangles;
    auto piece = begin;
    Cut(mesh, mesh.triangles[t], distance.spacing).for_each([&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
      if (*piece++) *number = add(a, b, c);
      ++number;
    });
  }
  boundary.kept = boundary.mesh.triangles.size();
  boundary.first_piece = std::move(first_piece);
  // Caps over holes.
  if (!winding.balanced()) {
    std::vector<SolidBoundary> caps(distance.size[2] - 1);
    parallel.for_each(static_cast<std::int64_t>(caps.size()),
                      [&](std::int64_t k) { add_caps(distance, winding.at_nodes(), static_cast<int>(k), caps[k]); });
    for (const SolidBoundary& slab : caps) {
      boundary.cap_triangles += slab.cap_triangles;
      for (const Triangle& t : slab.mesh.triangles)
        add_triangle(boundary.mesh, slab.mesh.points[t[0]], slab.mesh.points[t[1]], slab.mesh.points[t[2]]);
    }
  }
  boundary.differs = boundary.inner_triangles + boundary.cap_triangles > 0;
  return boundary;
}

std::int32_t SolidBoundary::triangle_at(const TriangleMesh& given, double spacing, std::int32_t triangle,
                                        const Vec3d& X) const {
  const std::size_t first = first_piece[triangle], count = first_piece[triangle + 1] - first;
  if (count == 0) return -1;
  return triangle_of_piece[count == 1 ? first : first + Cut(given, given.triangles[triangle], spacing).piece_at(X)];
}

}  // namespace efsi::geometry
