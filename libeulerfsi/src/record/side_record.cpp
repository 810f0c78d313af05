#include "record/side_record.hpp"

#include <algorithm>
#include <optional>

#include "contact/solid_contact.hpp"
#include "record/contact_record.hpp"

namespace efsi::sim {
namespace {

// Less deep than this a vertex is where it went in, or has left: the surface next to it tells the side [cells].
constexpr double kDeep = 0.5;

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

// What is remembered of a vertex that is deep in another solid; nothing where that is not certain.
std::optional<solid::DeepVertex> remember(const solid::DeepVertex* known, std::size_t other, const SeenVertex& seen) {
  const bool certain = seen.is_known();
  if (!known && !certain) return {};
  const Vec3 normal = seen.rest_normal().cast<Real>();
  solid::DeepVertex deep = known ? *known
                                 : solid::DeepVertex{static_cast<std::int32_t>(seen.vertex),
                                                     static_cast<std::int32_t>(other),
                                                     {normal[0], normal[1], normal[2]},
                                                     Real(0)};
  if (certain) deep.deepest = std::max(deep.deepest, static_cast<Real>(-seen.rest_distance));
  return deep;
}

// A vertex of a solid has come out on another side.
void count_vertex(std::size_t solid, const SeenVertex& seen, const Vec3d& place, const solid::DeepVertex& deep,
                  double h, ContactPair& pair) {
  if (pair.exchanged_vertices == 0) pair.exchanged_place = place;
  ++pair.exchanged_vertices;
  pair.surface_overlap = std::max(pair.surface_overlap, -seen.rest_distance / h);
  if (static_cast<double>(deep.deepest) > 0.5 * kResolved * h && !pair.passed)
    pair.passed = PassedVertex{solid, seen.vertex, place};
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
          count_vertex(l, seen, states[l].surface[seen.vertex], *known, h,
                       find_pair(pairs, std::min(l, other), std::max(l, other)));
        }
      });
    }
    states[l].deep = std::move(deep);
  }
}

}  // namespace efsi::sim
