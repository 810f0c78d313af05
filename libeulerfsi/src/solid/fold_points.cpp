#include "solid/fold_points.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "grid/interpolate.hpp"
#include "solid/inverse_map.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {
namespace {

constexpr double kFine = 0.5;    // boxes: longest side of the parts into which triangles are cut
constexpr double kFar = 2.0;     // boxes: side of a triangle whose points its corners do not place
constexpr double kBuried = 0.5;  // boxes: deeper in the solid there is no surface
constexpr double kHeld = 0.1;    // cells of material: a place with more left does not hold the point

// A part of a triangle, and in which box and on which side of it that is.
struct Part {
  std::array<std::int32_t, 4> key;  // box, side: +-1 +-2 +-3: the axis nearest to the normal
  std::int32_t triangle;
  double second, third, area;
  Vec3d place, normal;
};

double longest_side(const geometry::TriangleMesh& surface, const geometry::Triangle& t) {
  double longest = 0.0;
  for (std::size_t s = 0; s < 3; ++s)
    longest = std::max(longest, (surface.points[t[(s + 1) % 3]] - surface.points[t[s]]).norm());
  return longest;
}

std::int32_t side_of(const Vec3d& normal) {
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  return static_cast<std::int32_t>(normal[axis] < 0.0 ? -axis - 1 : axis + 1);
}

// The middles of the n^2 triangles into which lines parallel to its sides cut a triangle.
void cut(const geometry::TriangleMesh& surface, std::int32_t triangle, double spacing, std::vector<Part>& parts) {
  const geometry::Triangle& t = surface.triangles[static_cast<std::size_t>(triangle)];
  const Vec3d a = surface.points[t[0]], ab = surface.points[t[1]] - a, ac = surface.points[t[2]] - a;
  const Vec3d across = ab.cross(ac);
  const double area = 0.5 * across.norm();
  if (!(area > 0.0)) return;
  const int n = std::max(1, static_cast<int>(std::ceil(longest_side(surface, t) / (kFine * spacing))));
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j)
      for (int turned = 0; turned < (i + j + 1 < n ? 2 : 1); ++turned) {
        Part part;
        part.triangle = triangle;
        part.second = (i + (turned ? 2.0 : 1.0) / 3.0) / n;
        part.third = (j + (turned ? 2.0 : 1.0) / 3.0) / n;
        part.area = area / (n * n);
        part.place = a + part.second * ab + part.third * ac;
        part.normal = across / (2.0 * area);
        for (std::size_t x = 0; x < 3; ++x)
          part.key[x] = static_cast<std::int32_t>(std::floor(part.place[static_cast<Eigen::Index>(x)] / spacing));
        part.key[3] = side_of(part.normal);
        parts.push_back(part);
      }
}

}  // namespace

std::vector<FoldPoint> make_fold_points(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                        double spacing) {
  std::vector<Part> parts;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) cut(surface, static_cast<std::int32_t>(t), spacing, parts);
  std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return std::tie(a.key, a.triangle, a.second, a.third) < std::tie(b.key, b.triangle, b.second, b.third);
  });
  std::vector<FoldPoint> points;
  for (std::size_t begin = 0, end = 0; begin < parts.size(); begin = end) {
    Vec3d middle = Vec3d::Zero(), normal = Vec3d::Zero();
    double area = 0.0;
    for (end = begin; end < parts.size() && parts[end].key == parts[begin].key; ++end) {
      middle += parts[end].area * parts[end].place;
      normal += parts[end].area * parts[end].normal;
      area += parts[end].area;
    }
    middle /= area;
    const auto farther = [&](const Part& a, const Part& b) {
      return (a.place - middle).squaredNorm() < (b.place - middle).squaredNorm();
    };
    const auto from = parts.begin() + static_cast<std::ptrdiff_t>(begin);
    const Part& chosen = *std::min_element(from, parts.begin() + static_cast<std::ptrdiff_t>(end), farther);
    if (distance.sample(chosen.place) < -kBuried * spacing) continue;
    normal.normalize();
    FoldPoint point{chosen.triangle, static_cast<float>(chosen.second), static_cast<float>(chosen.third), {}, {}, 0};
    for (Eigen::Index a = 0; a < 3; ++a) {
      point.place[a] = static_cast<float>(chosen.place[a]);
      point.normal[a] = static_cast<float>(normal[a]);
    }
    const auto& corners = surface.triangles[static_cast<std::size_t>(chosen.triangle)];
    point.bends = longest_side(surface, corners) > kFar * spacing;
    points.push_back(point);
  }
  return points;
}

std::vector<Vec3d> place_fold_points(const Parallel& parallel, const SolidRest& rest, const SolidState& state) {
  const auto corner = grid::corner_offsets(state.band.grid);
  std::vector<Vec3d> places(rest.fold_points.size());
  parallel.for_each(static_cast<std::int64_t>(places.size()), [&](std::int64_t i) {
    const FoldPoint& p = rest.fold_points[static_cast<std::size_t>(i)];
    const geometry::Triangle& t = rest.surface.triangles[static_cast<std::size_t>(p.triangle)];
    const double second = static_cast<double>(p.second), third = static_cast<double>(p.third);
    Vec3d& x = places[static_cast<std::size_t>(i)];
    x = (1.0 - second - third) * state.surface[t[0]] + second * state.surface[t[1]] + third * state.surface[t[2]];
    if (!p.bends) return;
    Vec3d moved = x;
    const Vec3d at_rest(p.place[0], p.place[1], p.place[2]);
    if (correct_point(state, corner, at_rest, moved) < kHeld * state.band.grid.h) x = moved;
  });
  return places;
}

std::vector<NearPair> find_near_pairs(const Parallel& parallel, const std::vector<FoldPoint>& points,
                                      const std::vector<Vec3d>& places, double reach, double nearer) {
  if (points.empty()) return {};
  Vec3d low = places[0];
  for (const Vec3d& x : places) low = low.cwiseMin(x);
  // Boxes of edge `reach`, their points side by side.
  struct Entry {
    Vec3i box;  // z first: the order is that of the boxes
    std::int32_t point;
    float now[3], rest[3];
  };
  std::vector<Entry> entries(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    Entry& e = entries[i];
    e.point = static_cast<std::int32_t>(i);
    for (std::size_t a = 0; a < 3; ++a) {
      const double x = places[i][static_cast<Eigen::Index>(a)] - low[static_cast<Eigen::Index>(a)];
      e.box[a] = static_cast<int>(x / reach);
      e.now[a] = static_cast<float>(x);
      e.rest[a] = points[i].place[a];
    }
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return std::tie(a.box, a.point) < std::tie(b.box, b.point); });
  std::vector<std::size_t> begins;
  for (std::size_t i = 0; i < entries.size(); ++i)
    if (i == 0 || entries[i].box != entries[i - 1].box) begins.push_back(i);
  begins.push_back(entries.size());
  const float most = static_cast<float>(reach * reach), least = static_cast<float>(nearer * nearer);
  std::vector<std::vector<NearPair>> found(begins.size() - 1);
  parallel.for_each(static_cast<std::int64_t>(found.size()), [&](std::int64_t b) {
    const auto box = static_cast<std::size_t>(b);
    const auto compare = [&](std::size_t i, std::size_t j) {
      const Entry &p = entries[i], &q = entries[j];
      float now = 0, rest = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        now += (p.now[a] - q.now[a]) * (p.now[a] - q.now[a]);
        rest += (p.rest[a] - q.rest[a]) * (p.rest[a] - q.rest[a]);
      }
      if (now < most && rest > least * now)
        found[box].push_back({std::min(p.point, q.point), std::max(p.point, q.point), std::sqrt(now), std::sqrt(rest)});
    };
    for (std::size_t i = begins[box]; i < begins[box + 1]; ++i)
      for (std::size_t j = i + 1; j < begins[box + 1]; ++j) compare(i, j);
    // Boxes that come later, in rows of three along the last axis.
    const Vec3i middle = entries[begins[box]].box;
    for (int row = 4; row < 9; ++row) {
      const int x = middle[0] + row / 3 - 1, y = middle[1] + row % 3 - 1;
      const Vec3i from{x, y, row == 4 ? middle[2] + 1 : middle[2] - 1}, to{x, y, middle[2] + 1};
      const auto first = std::lower_bound(begins.begin(), begins.end() - 1, from,
                                          [&](std::size_t i, const Vec3i& key) { return entries[i].box < key; });
      for (auto at = first; at != begins.end() - 1 && entries[*at].box <= to; ++at)
        for (std::size_t i = begins[box]; i < begins[box + 1]; ++i)
          for (std::size_t j = *at; j < *(at + 1); ++j) compare(i, j);
    }
  });
  std::vector<NearPair> pairs;
  for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
  std::sort(pairs.begin(), pairs.end(),
            [](const NearPair& a, const NearPair& b) { return std::tie(a.one, a.other) < std::tie(b.one, b.other); });
  return pairs;
}

}  // namespace efsi::solid
