#include "geometry/nearest_triangle.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

namespace efsi::geometry {
namespace {

constexpr double kSlack = 1e-9;  // for rounding
constexpr double kRounding = 1.0 + kSlack;
constexpr std::int32_t kLeaf = 4;  // triangles that are not divided further

double squared_distance(const Vec3d& min, const Vec3d& max, const Vec3d& x) {
  return (x - x.cwiseMax(min).cwiseMin(max)).squaredNorm();
}

// The point of a segment that is nearest to x.
inline Vec3d on_segment(const Vec3d& a, const Vec3d& b, const Vec3d& x) {
  const Vec3d way = b - a;
  const double length = way.squaredNorm();
  return length > 0.0 ? Vec3d(a + std::clamp((x - a).dot(way) / length, 0.0, 1.0) * way) : a;
}

}  // namespace

Vec3d closest_point(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& x) {
  const Vec3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  if (square > 0.0) {
    // Inside all three edges the foot of the perpendicular is the nearest point, else a point of an edge that x is
    // outside of.
    const auto inside = [&](const Vec3d& p, const Vec3d& q) { return (q - p).cross(x - p).dot(normal) >= 0.0; };
    const bool in_ab = inside(a, b), in_bc = inside(b, c), in_ca = inside(c, a);
    if (in_ab && in_bc && in_ca) return x - (x - a).dot(normal) / square * normal;
    if (in_bc && in_ca) return on_segment(a, b, x);
    if (in_ab && in_ca) return on_segment(b, c, x);
    if (in_ab && in_bc) return on_segment(c, a, x);
  }
  Vec3d best = on_segment(a, b, x);
  for (const Vec3d& other : {on_segment(b, c, x), on_segment(c, a, x)})
    if ((other - x).squaredNorm() < (best - x).squaredNorm()) best = other;
  return best;
}

Vec3d closest_weights(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& x) {
  const Vec3d p = closest_point(a, b, c, x);
  const Vec3d normal = (b - a).cross(c - a);
  const std::array<Vec3d, 3> corner{a, b, c};
  Vec3d weights = Vec3d::Zero();
  if (normal.squaredNorm() > 0.0) {
    for (std::size_t k = 0; k < 3; ++k)
      weights[static_cast<int>(k)] =
          std::max(0.0, (corner[(k + 2) % 3] - corner[(k + 1) % 3]).cross(p - corner[(k + 1) % 3]).dot(normal));
  } else {  // without an area the point lies on the longest edge
    std::size_t from = 0;
    const auto edge = [&](std::size_t k) -> Vec3d { return corner[(k + 1) % 3] - corner[k]; };
    for (std::size_t k = 1; k < 3; ++k)
      if (edge(k).squaredNorm() > edge(from).squaredNorm()) from = k;
    const double square = edge(from).squaredNorm();
    const double part = square > 0.0 ? std::clamp((p - corner[from]).dot(edge(from)) / square, 0.0, 1.0) : 0.0;
    weights[static_cast<int>(from)] = 1.0 - part;
    weights[static_cast<int>((from + 1) % 3)] = part;
  }
  return weights / weights.sum();
}

NearestTriangle::NearestTriangle(const TriangleMesh& mesh) {
  leaves_.reserve(mesh.triangles.size());
  for (const Triangle& t : mesh.triangles) {
    Leaf leaf{{mesh.points[static_cast<std::size_t>(t[0])], mesh.points[static_cast<std::size_t>(t[1])],
               mesh.points[static_cast<std::size_t>(t[2])]},
              Vec3d::Zero(),
              Vec3d::Zero(),
              0.0,
              static_cast<std::int32_t>(leaves_.size())};
    leaf.middle = (leaf.corner[0] + leaf.corner[1] + leaf.corner[2]) / 3.0;
    const Vec3d area = (leaf.corner[1] - leaf.corner[0]).cross(leaf.corner[2] - leaf.corner[0]);
    if (area.squaredNorm() > 0.0) leaf.normal = area / area.norm();
    for (const Vec3d& x : leaf.corner) leaf.radius = std::max(leaf.radius, kRounding * (x - leaf.middle).norm());
    leaves_.push_back(leaf);
  }
  if (!leaves_.empty()) build(0, static_cast<std::int32_t>(leaves_.size()));
}

void NearestTriangle::build(std::int32_t begin, std::int32_t end) {
  const auto first = leaves_.begin() + begin, last = leaves_.begin() + end;
  Box box{first->corner[0], first->corner[0], begin, end, 0};
  for (auto leaf = first; leaf != last; ++leaf)
    for (const Vec3d& x : leaf->corner) {
      box.min = box.min.cwiseMin(x);
      box.max = box.max.cwiseMax(x);
    }
  const std::size_t at = boxes_.size();
  boxes_.push_back(box);
  if (end - begin <= kLeaf) return;
  Eigen::Index axis = 0;
  (box.max - box.min).maxCoeff(&axis);
  const std::int32_t half = begin + (end - begin) / 2;
  std::nth_element(first, leaves_.begin() + half, last, [&](const Leaf& a, const Leaf& b) {
    return std::pair(a.middle[axis], a.triangle) < std::pair(b.middle[axis], b.triangle);
  });
  build(begin, half);
  boxes_[at].right = static_cast<std::int32_t>(boxes_.size());
  build(half, end);
}

NearestTriangle::Found NearestTriangle::find(const Vec3d& x, std::int32_t guess) const {
  Found found;
  double best = std::numeric_limits<double>::infinity(), reach = best;  // the square and, a little more, its root
  const auto look_at = [&](std::int32_t l) {
    const Leaf& leaf = leaves_[static_cast<std::size_t>(l)];
    // Whether the disc around the triangle, in its plane, is within reach.
    const Vec3d off = x - leaf.middle;
    const double height = std::max(std::abs(off.dot(leaf.normal)) - kSlack * leaf.radius, 0.0);
    const double left = reach * reach - height * height;
    if (left < 0.0) return;
    const double most = std::sqrt(left) + leaf.radius;
    if (off.squaredNorm() - height * height > most * most) return;
    const double square = (closest_point(leaf.corner[0], leaf.corner[1], leaf.corner[2], x) - x).squaredNorm();
    if (!(square < best || (square == best && leaf.triangle < found.triangle))) return;
    best = square;
    reach = kRounding * std::sqrt(square);
    found.triangle = leaf.triangle;
    found.leaf = l;
  };
  if (guess >= 0) look_at(guess);
  struct Open {
    std::int32_t box;
    double square;  // of the distance to it
  };
  std::array<Open, 64> open;  // one per level of the tree and one more, which halves up to 2^31 leaves
  std::size_t count = 0;
  const auto square_of = [&](std::int32_t b) {
    return squared_distance(boxes_[static_cast<std::size_t>(b)].min, boxes_[static_cast<std::size_t>(b)].max, x);
  };
  if (!boxes_.empty()) open[count++] = {0, square_of(0)};
  while (count > 0) {
    const Open next = open[--count];
    if (next.square > best) continue;
    const Box& box = boxes_[static_cast<std::size_t>(next.box)];
    if (box.right == 0) {
      for (std::int32_t l = box.begin; l < box.end; ++l) look_at(l);
      continue;
    }
    // The nearer child is looked at first.
    const Open left{next.box + 1, square_of(next.box + 1)}, right{box.right, square_of(box.right)};
    const bool left_first = left.square <= right.square;
    const Open &near = left_first ? left : right, &far = left_first ? right : left;
    if (far.square <= best) open[count++] = far;
    if (near.square <= best) open[count++] = near;
  }
  found.distance = std::sqrt(best);
  return found;
}

}  // namespace efsi::geometry
