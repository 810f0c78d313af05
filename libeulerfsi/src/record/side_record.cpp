#include "record/side_record.hpp"

#include <algorithm>
#include <optional>

#include "contact/solid_contact.hpp"
#include "record/contact_record.hpp"

namespace efsi::sim {
namespace {

// Less deep than this a vertex is where it went in, or has left: the surface next to it tells the side [cells].
constexpr double kDeep = 0.5;
constexpr double kStride = 0.125;           // cells, of the way through the other solid
constexpr double kThick = kResolved - 0.5;  // cells: what is kResolved thick, as its distance on a grid tells

using DeepVertices = std::vector<solid::DeepVertex>;

const solid::DeepVertex* find(const DeepVertices& deep, std::size_t other, std::size_t vertex) {
  const auto before = [](const solid::DeepVertex& d, const std::pair<std::size_t, std::size_t>& key) {
    return std::pair(static_cast<std::size_t>(d.other), static_cast<std::size_t>(d.vertex)) < key;
  };
  const auto place = std::lower_bound(deep.begin(), deep.end(), std::pair(other, vertex), before);
  const bool found = place != deep.end() && static_cast<std::size_t>(place->other) == other &&
                     static_cast<std::size_t>(place->vertex) == vertex;
  return found ? &*place : nullptr;
}

// How thick the other solid is at rest between the side by which a vertex went in and the one by which it has come out
// [cells], at most kResolved. in: the normal of the first.
double thickness(const SeenVertex& seen, const Vec3d& in, double h) {
  const geometry::SignedDistance& distance = solid::distance_of(seen.rest, seen.state);
  double inside = std::max(0.0, -seen.rest_distance / h);
  for (double way = kStride; inside < kResolved && way < 2.0 * kResolved; way += kStride) {
    if (distance.sample(seen.material + way * h * in) < 0.0)
      inside += kStride;
    else if (inside > 0.0)
      break;
  }
  return inside;
}

// What is remembered of a vertex that is deep in another solid; nothing where that is not certain.
std::optional<solid::DeepVertex> remember(const solid::DeepVertex* known, std::size_t other, const SeenVertex& seen) {
  if (known) return *known;
  if (!seen.is_known()) return {};
  const Vec3 normal = seen.rest_normal().cast<Real>();
  return solid::DeepVertex{
      static_cast<std::int32_t>(seen.vertex), static_cast<std::int32_t>(other), {normal[0], normal[1], normal[2]}};
}

// A vertex of a solid has come out on another side.
void count_vertex(std::size_t solid, const SeenVertex& seen, const solid::DeepVertex& deep, double h,
                  ContactPair& pair) {
  if (pair.exchanged_vertices == 0) pair.exchanged_place = seen.x;
  ++pair.exchanged_vertices;
  pair.surface_overlap = std::max(pair.surface_overlap, -seen.rest_distance / h);
  if (pair.passed) return;
  const Vec3d in(static_cast<double>(deep.normal[0]), static_cast<double>(deep.normal[1]),
                 static_cast<double>(deep.normal[2]));
  if (thickness(seen, in, h) > kThick) pair.passed = PassedVertex{solid, seen.vertex, seen.x};
}

}  // namespace

void record_sides(const Scene& scene, SolidStates& states, ContactPairs& pairs) {
  const double h = scene.grid.h;
  for (std::size_t l = 0; l < states.size(); ++l) {
    DeepVertices deep;  // in the order of (other, vertex)
    for (std::size_t other = 0; other < states.size(); ++other) {
      if (other == l || (is_collider(scene.pins, l) && is_collider(scene.pins, other))) continue;
      visit_vertices(scene, states, l, other, [&](const SeenVertex& seen) {
        const solid::DeepVertex* known = find(states[l].deep, other, seen.vertex);
        if (seen.rest_distance < -kDeep * h) {
          if (const auto now = remember(known, other, seen)) deep.push_back(*now);
        } else if (known && seen.rest_normal().cast<Real>().dot(Vec3(known->normal)) < 0) {
          count_vertex(l, seen, *known, h, find_pair(pairs, std::min(l, other), std::max(l, other)));
        }
      });
    }
    states[l].deep = std::move(deep);
  }
}

}  // namespace efsi::sim
