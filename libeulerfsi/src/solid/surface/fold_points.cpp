#include "solid/surface/fold_points.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "grid/interpolate.hpp"
#include "solid/map/inverse_map.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {
namespace {

constexpr double kFine = 0.5;    // boxes: longest side of the parts into which triangles are cut
constexpr double kFar = 2.0;     // boxes: side of a triangle whose points its corners do not place
constexpr double kBuried = 0.5;  // boxes: deeper in the solid there is no surface
constexpr double kAlike = 0.5;   // cosine of normals: sides of the surface in a box that one point stands for

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
  // Parts of the triangles by box and side.
  std::vector<Part> parts;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) cut(surface, static_cast<std::int32_t>(t), spacing, parts);
  std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return std::tie(a.key, a.triangle, a.second, a.third) < std::tie(b.key, b.triangle, b.second, b.third);
  });
  std::vector<FoldPoint> points;
  std::vector<Eigen::Vector3f> taken;  // normals of the points of a box
  for (std::size_t begin = 0, end = 0; begin < parts.size(); begin = end) {
    const auto box = [&](std::size_t i) { return Vec3i{parts[i].key[0], parts[i].key[1], parts[i].key[2]}; };
    if (begin == 0 || box(begin) != box(begin - 1)) taken.clear();
    // Mean of the parts of one box and side; the nearest part becomes the point.
    Vec3d middle = Vec3d::Zero(), normal = Vec3d::Zero();
    double area = 0.0;
    for (end = begin; end < parts.size() && parts[end].key == parts[begin].key; ++end) {
      middle += parts[end].area * parts[end].place;
      normal += parts[end].area * parts[end].normal;
      area += parts[end].area;
    }
    middle /= area;
    normal.normalize();
    const auto nearer = [&](const Part& a, const Part& b) {
      return (a.place - middle).squaredNorm() < (b.place - middle).squaredNorm();
    };
    const auto from = parts.begin() + static_cast<std::ptrdiff_t>(begin);
    const Part& chosen = *std::min_element(from, parts.begin() + static_cast<std::ptrdiff_t>(end), nearer);
    const Eigen::Vector3f out = normal.cast<float>();
    // One point per side that differs, none inside the solid.
    const bool alike = std::any_of(taken.begin(), taken.end(), [&](const auto& n) { return n.dot(out) > kAlike; });
    if (alike || distance.sample(chosen.place) < -kBuried * spacing) continue;
    taken.push_back(out);
    FoldPoint point{chosen.triangle, static_cast<float>(chosen.second), static_cast<float>(chosen.third), {}, {}, 0};
    for (Eigen::Index a = 0; a < 3; ++a) {
      point.place[a] = static_cast<float>(chosen.place[a]);
      point.normal[a] = out[a];
    }
    const auto& corners = surface.triangles[static_cast<std::size_t>(chosen.triangle)];
    point.bends = longest_side(surface, corners) > kFar * spacing;
    points.push_back(point);
  }
  return points;
}

FoldPlaces place_fold_points(const Parallel& parallel, const SolidRest& rest, const SolidState& state) {
  const auto corner = grid::corner_offsets(state.band.grid);
  FoldPlaces places;
  places.place.resize(rest.fold_points.size());
  places.normal.resize(rest.fold_points.size());
  parallel.for_each(static_cast<std::int64_t>(rest.fold_points.size()), [&](std::int64_t i) {
    const auto n = static_cast<std::size_t>(i);
    const FoldPoint& p = rest.fold_points[n];
    const geometry::Triangle& t = rest.surface.triangles[static_cast<std::size_t>(p.triangle)];
    const double second = static_cast<double>(p.second), third = static_cast<double>(p.third);
    const Vec3d &a = state.surface[t[0]], &b = state.surface[t[1]], &c = state.surface[t[2]];
    Vec3d& x = places.place[n];
    x = (1.0 - second - third) * a + second * b + third * c;
    const Vec3d across = (b - a).cross(c - a);
    const double length = across.norm();
    places.normal[n] = length > 0.0 ? Eigen::Vector3f((across / length).cast<float>()) : Eigen::Vector3f::Zero();
    if (!p.bends) return;
    Vec3d moved = x;
    if (correct_point(state, corner, p.at_rest(), moved) < kHeldResidual * state.band.grid.h) x = moved;
  });
  return places;
}

namespace {

// Boxes of the present space by their numbers, that along the last axis counts fastest.
using BoxKey = std::uint64_t;
BoxKey box_key(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<BoxKey>(x) << 42 | static_cast<BoxKey>(y) << 21 | static_cast<BoxKey>(z);
}

// A point in a box.
struct Entry {
  Eigen::Vector3f now, rest, normal;
  std::int32_t point;
};

// The points of a box, and the range of their normals.
struct Box {
  BoxKey key;
  std::size_t begin, end;
  std::array<int, 3> place;
  Eigen::Array3f low, high;
};

// Whether some normal of one box may point against some of the other: no product of theirs is less than this.
bool may_oppose(const Box& a, const Box& b) {
  const Eigen::Array3f ll = a.low * b.low, lh = a.low * b.high, hl = a.high * b.low, hh = a.high * b.high;
  return ll.min(lh).min(hl.min(hh)).sum() < 0.0f;
}

// edge: of the boxes [m]
std::vector<Box> sort_into_boxes(const std::vector<FoldPoint>& points, const FoldPlaces& places, double edge,
                                 std::vector<Entry>& entries) {
  Vec3d low = places.place[0];
  for (const Vec3d& x : places.place) low = low.cwiseMin(x);
  const auto box_of = [&](std::size_t point, std::size_t axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    return static_cast<int>((places.place[point][a] - low[a]) / edge);
  };
  std::vector<std::pair<BoxKey, std::int32_t>> order(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    order[i] = {box_key(box_of(i, 0), box_of(i, 1), box_of(i, 2)), static_cast<std::int32_t>(i)};
  std::sort(order.begin(), order.end());
  entries.resize(points.size());
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto p = static_cast<std::size_t>(order[i].second);
    const Eigen::Vector3f& normal = places.normal[p];
    entries[i] = {(places.place[p] - low).cast<float>(),
                  {points[p].place[0], points[p].place[1], points[p].place[2]},
                  normal,
                  order[i].second};
    if (boxes.empty() || order[i].first != boxes.back().key)
      boxes.push_back({order[i].first, i, i, {box_of(p, 0), box_of(p, 1), box_of(p, 2)}, normal, normal});
    Box& box = boxes.back();
    box.end = i + 1;
    box.low = box.low.min(normal.array());
    box.high = box.high.max(normal.array());
  }
  return boxes;
}

}  // namespace

std::vector<NearPair> find_near_pairs(const Parallel& parallel, const std::vector<FoldPoint>& points,
                                      const FoldPlaces& places, double reach, double nearer) {
  constexpr int kBoxes = 3;  // a box is reach / kBoxes wide
  if (points.empty()) return {};
  std::vector<Entry> entries;
  const std::vector<Box> boxes = sort_into_boxes(points, places, reach / kBoxes, entries);
  const float most = static_cast<float>(reach * reach), least = static_cast<float>(nearer * nearer);
  std::vector<std::vector<NearPair>> found(boxes.size());
  parallel.for_each(static_cast<std::int64_t>(boxes.size()), [&](std::int64_t n) {
    const Box& box = boxes[static_cast<std::size_t>(n)];
    const auto compare = [&](const Entry& p, const Entry& q) {
      const float now = (p.now - q.now).squaredNorm();
      if (!(now < most && p.normal.dot(q.normal) < 0.0f)) return;
      const float rest = (p.rest - q.rest).squaredNorm();
      if (!(rest > least * now)) return;
      const auto [one, other] = std::minmax(p.point, q.point);
      found[static_cast<std::size_t>(n)].push_back({one, other, std::sqrt(now), std::sqrt(rest)});
    };
    if (may_oppose(box, box))
      for (std::size_t i = box.begin; i < box.end; ++i)
        for (std::size_t j = i + 1; j < box.end; ++j) compare(entries[i], entries[j]);
    // Boxes that come later, in rows along the last axis.
    auto from = boxes.begin() + n + 1;
    for (int dx = 0; dx <= kBoxes; ++dx)
      for (int dy = dx == 0 ? 0 : -kBoxes; dy <= kBoxes; ++dy) {
        const int x = box.place[0] + dx, y = box.place[1] + dy, z = box.place[2];
        if (y < 0) continue;
        const int first = dx == 0 && dy == 0 ? z + 1 : std::max(0, z - kBoxes);
        from = std::lower_bound(from, boxes.end(), box_key(x, y, first),
                                [](const Box& b, BoxKey key) { return b.key < key; });
        for (; from != boxes.end() && from->key <= box_key(x, y, z + kBoxes); ++from) {
          if (!may_oppose(box, *from)) continue;
          for (std::size_t i = box.begin; i < box.end; ++i)
            for (std::size_t j = from->begin; j < from->end; ++j) compare(entries[i], entries[j]);
        }
      }
  });
  std::vector<NearPair> pairs;
  for (const auto& some : found) pairs.insert(pairs.end(), some.begin(), some.end());
  std::sort(pairs.begin(), pairs.end(),
            [](const NearPair& a, const NearPair& b) { return std::tie(a.one, a.other) < std::tie(b.one, b.other); });
  return pairs;
}

}  // namespace efsi::solid
