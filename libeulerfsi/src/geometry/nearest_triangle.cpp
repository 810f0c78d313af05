#include "geometry/nearest_triangle.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace efsi::geometry {
namespace {

constexpr std::int32_t kLeaf = 4;  // triangles that are not divided further

double squared_distance(const Vec3d& min, const Vec3d& max, const Vec3d& x) {
  return (x - x.cwiseMax(min).cwiseMin(max)).squaredNorm();
}

// The point of a segment that is nearest to x.
Vec3d on_segment(const Vec3d& a, const Vec3d& b, const Vec3d& x) {
  const Vec3d way = b - a;
  const double length = way.squaredNorm();
  return length > 0.0 ? Vec3d(a + std::clamp((x - a).dot(way) / length, 0.0, 1.0) * way) : a;
}

}  // namespace

Vec3d closest_point(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& x) {
  const Vec3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  if (square > 0.0) {
    // Inside all three edges the foot of the perpendicular is the nearest point.
    const auto inside = [&](const Vec3d& p, const Vec3d& q) { return (q - p).cross(x - p).dot(normal) >= 0.0; };
    if (inside(a, b) && inside(b, c) && inside(c, a)) return x - (x - a).dot(normal) / square * normal;
  }
  Vec3d best = on_segment(a, b, x);
  for (const Vec3d& other : {on_segment(b, c, x), on_segment(c, a, x)})
    if ((other - x).squaredNorm() < (best - x).squaredNorm()) best = other;
  return best;
}

NearestTriangle::NearestTriangle(const TriangleMesh& mesh) {
  for (const Triangle& t : mesh.triangles)
    leaves_.push_back({{mesh.points[static_cast<std::size_t>(t[0])], mesh.points[static_cast<std::size_t>(t[1])],
                        mesh.points[static_cast<std::size_t>(t[2])]},
                       static_cast<std::int32_t>(leaves_.size())});
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
  const auto middle = [axis](const Leaf& l) { return l.corner[0][axis] + l.corner[1][axis] + l.corner[2][axis]; };
  std::sort(first, last, [&](const Leaf& a, const Leaf& b) {
    return std::pair(middle(a), a.triangle) < std::pair(middle(b), b.triangle);
  });
  const std::int32_t half = begin + (end - begin) / 2;
  build(begin, half);
  boxes_[at].right = static_cast<std::int32_t>(boxes_.size());
  build(half, end);
}

NearestTriangle::Found NearestTriangle::find(const Vec3d& x) const {
  Found found;
  double best = std::numeric_limits<double>::infinity();
  std::vector<std::int32_t> open;
  if (!boxes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const std::int32_t at = open.back();
    const Box& box = boxes_[static_cast<std::size_t>(at)];
    open.pop_back();
    if (squared_distance(box.min, box.max, x) > best) continue;
    if (box.right == 0) {
      for (std::int32_t l = box.begin; l < box.end; ++l) {
        const Leaf& leaf = leaves_[static_cast<std::size_t>(l)];
        const double square = (closest_point(leaf.corner[0], leaf.corner[1], leaf.corner[2], x) - x).squaredNorm();
        if (square < best || (square == best && leaf.triangle < found.triangle)) {
          best = square;
          found.triangle = leaf.triangle;
        }
      }
      continue;
    }
    // The nearer child is looked at first.
    const std::int32_t left = at + 1, right = box.right;
    const auto square_of = [&](std::int32_t b) {
      return squared_distance(boxes_[static_cast<std::size_t>(b)].min, boxes_[static_cast<std::size_t>(b)].max, x);
    };
    const bool left_first = square_of(left) <= square_of(right);
    open.push_back(left_first ? right : left);
    open.push_back(left_first ? left : right);
  }
  found.distance = std::sqrt(best);
  return found;
}

}  // namespace efsi::geometry
