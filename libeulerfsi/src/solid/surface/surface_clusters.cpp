#include "solid/surface/surface_clusters.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/disjoint_sets.hpp"

namespace efsi::solid {
namespace {

constexpr double kLongestLink = 3.0;  // boxes: farther away nothing moves as if it were rigid

using Pairs = std::vector<std::pair<std::int32_t, std::int32_t>>;

std::vector<Vec3i> boxes_of(const std::vector<Vec3d>& points, double spacing) {
  std::vector<Vec3i> boxes(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t a = 0; a < 3; ++a)
      boxes[i][a] = static_cast<int>(std::floor(points[i][static_cast<Eigen::Index>(a)] / spacing));
  return boxes;
}

template <class Visit>
void for_sides(const geometry::TriangleMesh& surface, const Visit& visit) {
  for (const geometry::Triangle& t : surface.triangles)
    for (std::size_t side = 0; side < 3; ++side)
      visit(static_cast<std::size_t>(t[side]), static_cast<std::size_t>(t[(side + 1) % 3]));
}

// Sorted pairs (a, b) as lists: those of a are list[first[a]] .. list[first[a + 1]].
void to_lists(const Pairs& pairs, std::size_t count, std::vector<std::int32_t>& first,
              std::vector<std::int32_t>& list) {
  first.assign(count + 1, 0);
  for (const auto& [a, b] : pairs) {
    ++first[static_cast<std::size_t>(a) + 1];
    list.push_back(b);
  }
  for (std::size_t c = 0; c < count; ++c) first[c + 1] += first[c];
}

// Numbers the clusters by their first points.
void number_clusters(const geometry::TriangleMesh& surface, const std::vector<Vec3i>& boxes, SurfaceClusters& made) {
  DisjointSets joined(boxes.size());
  for_sides(surface, [&](std::size_t a, std::size_t b) {
    if (boxes[a] == boxes[b]) joined.unite(a, b);
  });
  made.of_point.assign(boxes.size(), -1);
  Pairs members;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    std::int32_t& cluster = made.of_point[joined.find(i)];  // the root of a set is its first point
    if (cluster < 0) {
      cluster = static_cast<std::int32_t>(made.center.size());
      made.center.push_back(Vec3d::Zero());
    }
    made.of_point[i] = cluster;
    members.emplace_back(cluster, static_cast<std::int32_t>(i));
    made.center[static_cast<std::size_t>(cluster)] += surface.points[i];
  }
  std::sort(members.begin(), members.end());
  to_lists(members, made.size(), made.first, made.points);
  for (std::size_t c = 0; c < made.size(); ++c) made.center[c] /= made.first[c + 1] - made.first[c];
}

}  // namespace

SurfaceClusters make_surface_clusters(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                      double spacing) {
  SurfaceClusters made;
  const std::vector<Vec3i> boxes = boxes_of(surface.points, spacing);
  number_clusters(surface, boxes, made);
  Pairs links;
  for_sides(surface, [&](std::size_t a, std::size_t b) {
    const std::int32_t from = made.of_point[a], to = made.of_point[b];
    const bool near = (surface.points[a] - surface.points[b]).norm() < kLongestLink * spacing;
    if (from == to || !near) return;
    links.emplace_back(from, to);
    links.emplace_back(to, from);
  });
  std::map<Vec3i, std::vector<std::int32_t>> in_box;
  const auto box = [&](std::size_t c) { return boxes[static_cast<std::size_t>(made.points[made.first[c]])]; };
  for (std::size_t c = 0; c < made.size(); ++c) in_box[box(c)].push_back(static_cast<std::int32_t>(c));
  for (std::size_t c = 0; c < made.size(); ++c)
    for (int n = 0; n < 27; ++n) {
      const Vec3i middle = box(c);
      const auto beside = in_box.find({middle[0] + n % 3 - 1, middle[1] + n / 3 % 3 - 1, middle[2] + n / 9 - 1});
      if (beside == in_box.end()) continue;
      for (const std::int32_t other : beside->second) {
        const auto o = static_cast<std::size_t>(other);
        if (o != c && distance.sample(0.5 * (made.center[c] + made.center[o])) < 0.0)
          links.emplace_back(static_cast<std::int32_t>(c), other);
      }
    }
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  to_lists(links, made.size(), made.first_link, made.link);
  return made;
}

}  // namespace efsi::solid
