#include "contact/fold_contact.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include "contact/push_out.hpp"
#include "grid/interpolate.hpp"
#include "solid/hexahedron.hpp"
#include "solid/map/displacement.hpp"
#include "solid/surface/fold_points.hpp"

namespace efsi::sim {

using grid::Grid;
using solid::FoldPoint;
using solid::NearPair;

namespace {

constexpr double kStandOff = 3.0;       // cells: distance of folds, so that one map can represent both
constexpr double kOfRest = 0.5;         // or this part of what is between them at rest
constexpr double kLeastApproach = 1.5;  // times: a pair of points has come nearer than at rest
constexpr double kRowGap = 0.5;         // cells: rows below this gap, or where it would close in the step
constexpr double kRowReach = 5.0;       // cells: points farther apart have no row
constexpr double kSeen = 6.0;           // cells: from here on points limit the step
constexpr double kMostCosine = -0.3;    // cosine of the normals, at most
constexpr double kMostBeside = 1.0;     // cells: points farther beside each other do not face each other
constexpr double kSameMaterial = 2.0;   // cells: material as near to a point's as this is the point's own

// A point where it is, with its element.
struct Side {
  Vec3d place, normal;
  Mat3d f = Mat3d::Identity();  // F of the element
  std::optional<Vec3i> element;
};

// How far apart folds stay [m] that are at_rest [m] apart in the rest shape.
double stand_off(double at_rest, double h) { return std::min(kStandOff * h, kOfRest * at_rest); }

// The element that holds the material of a point, and its normal: F^-T N. alike: [m] of material.
Side find_side(const FoldPoint& point, const Vec3d& x, double alike, const solid::SolidState& state,
               const solid::SolidWork& work) {
  const Grid& g = state.band.grid;
  const Vec3d material = point.at_rest();
  Side side{x, Vec3d::Zero(), Mat3d::Identity(), {}};
  side.element = nearest_element(
      g, work, x, [&](const Vec3i& cell) { return (solid::material_in_cell(state, cell) - material).norm() < alike; });
  if (!side.element) return side;
  const Vec3i& cell = *side.element;
  const std::size_t n = g.node(cell[0], cell[1], cell[2]);
  const auto corner = grid::corner_offsets(g);
  Vec3d u[8];
  for (std::size_t c = 0; c < 8; ++c) u[c] = state.u.at(n + corner[c]).cast<double>();
  const Mat3d inverse_f = Mat3d::Identity() - solid::displacement_gradient(u, solid::center_gradients(), g.h);
  side.f = inverse_f.inverse();
  side.normal = (inverse_f.transpose() * Vec3d(point.normal[0], point.normal[1], point.normal[2])).normalized();
  return side;
}

// Whether two points face each other along the mean of their normals, which is out of the first.
bool face(const Side& a, const Side& b, double h, Vec3d& normal) {
  if (!(a.normal.dot(b.normal) < kMostCosine)) return false;
  const Vec3d way = b.place - a.place;
  if (!(way.dot(a.normal) > 0.0 && way.dot(b.normal) < 0.0)) return false;
  normal = (a.normal - b.normal).normalized();
  return (way - normal.dot(way) * normal).norm() < kMostBeside * h;
}

// What is between two points at rest, or less where the solid is pressed there: a whole that shrinks has no folds.
double between(const FoldPoint& one, const Side& a, const FoldPoint& other, const Side& b) {
  const Vec3d way = other.at_rest() - one.at_rest();
  return std::min({way.norm(), (a.f * way).norm(), (b.f * way).norm()});
}

// Each point with the nearest one that it faces.
std::set<std::pair<std::int32_t, std::int32_t>> choose(const std::vector<NearPair>& pairs,
                                                       const std::vector<Side>& sides, double h) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  std::vector<float> least(sides.size(), kNone);
  std::vector<std::int32_t> nearest(sides.size(), -1);
  for (const NearPair& pair : pairs) {
    const auto one = static_cast<std::size_t>(pair.one), other = static_cast<std::size_t>(pair.other);
    Vec3d normal;
    if (!sides[one].element || !sides[other].element || !face(sides[one], sides[other], h, normal)) continue;
    const auto look = [&](std::size_t from, std::int32_t to) {
      if (!(pair.distance < least[from])) return;
      least[from] = pair.distance;
      nearest[from] = to;
    };
    look(one, pair.other);
    look(other, pair.one);
  }
  std::set<std::pair<std::int32_t, std::int32_t>> chosen;
  for (std::size_t i = 0; i < sides.size(); ++i)
    if (nearest[i] >= 0) chosen.insert(std::minmax(static_cast<std::int32_t>(i), nearest[i]));
  return chosen;
}

// Impulses of the last step are the initial guess of the points' rows in this one, with any partner.
void recall(const solid::SolidState& state, std::int32_t l, double dt, std::vector<FoundRow>& rows) {
  for (FoundRow& row : rows) {
    const solid::ContactImpulse* best = nullptr;
    int alike = 0;
    for (const solid::ContactImpulse& press : state.contacts) {
      if (press.other != l) continue;
      const int same = 2 * (press.cell[0] == row.place.cell[0]) + (press.cell[1] == row.place.cell[1]);
      if (same <= alike) continue;
      alike = same;
      best = &press;
    }
    if (best) row.contact.normal_impulse = dt * static_cast<double>(best->force);
  }
}

}  // namespace

void find_near_folds(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                     solid::SolidWork& work) {
  work.fold_places = solid::place_fold_points(parallel, rest, state);
  work.near_folds =
      solid::find_near_pairs(parallel, rest.fold_points, work.fold_places, kSeen * state.band.grid.h, kLeastApproach);
  if (work.near_folds.empty()) work.fold_places = {};
}

std::vector<FoundRow> find_folds(const StepContext& step, std::size_t l, const solid::SolidState& state,
                                 const solid::SolidWork& work, const Grid& common, const NodeVelocity& velocity) {
  const solid::SolidRest& rest = step.scene.solids[l];
  const double h = step.scene.grid.h;
  std::vector<NearPair> pairs = work.near_folds;
  std::erase_if(pairs, [&](const NearPair& pair) { return !(static_cast<double>(pair.distance) < kRowReach * h); });
  if (pairs.empty()) return {};
  const solid::FoldPlaces& places = work.fold_places;
  std::vector<float> apart(places.place.size(),
                           std::numeric_limits<float>::infinity());  // from the nearest one, at rest
  for (const NearPair& pair : pairs)
    for (const std::int32_t p : {pair.one, pair.other})
      apart[static_cast<std::size_t>(p)] = std::min(apart[static_cast<std::size_t>(p)], pair.at_rest);
  std::vector<Side> sides(places.place.size());
  step.parallel.for_each(static_cast<std::int64_t>(places.place.size()), [&](std::int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    if (!std::isfinite(apart[p])) return;
    const double alike = std::max(kSameMaterial * h, 0.5 * static_cast<double>(apart[p]));
    sides[p] = find_side(rest.fold_points[p], places.place[p], alike, state, work);
  });
  std::vector<FoundRow> rows;
  for (const auto& [one, other] : choose(pairs, sides, h)) {
    const Side &a = sides[static_cast<std::size_t>(one)], &b = sides[static_cast<std::size_t>(other)];
    FoundRow row;
    face(a, b, h, row.contact.normal);
    const Vec3d middle = 0.5 * (a.place + b.place);
    const double distance = row.contact.normal.dot(b.place - a.place);
    const double skin = stand_off(between(rest.fold_points[static_cast<std::size_t>(one)], a,
                                          rest.fold_points[static_cast<std::size_t>(other)], b),
                                  h);
    row.place = {{l, l}, {one, other, 0}, distance - skin, skin, false};
    row.contact.least = least_velocity(row.place.gap, step);
    const auto add = [&](const Side& side, double along, double sign) {
      add_parts(state.band.grid, *side.element, common, middle + along * distance * row.contact.normal, sign,
                row.contact.parts);
    };
    add(a, -0.5, -1.0);
    add(b, 0.5, 1.0);
    const bool meets = row.contact.normal.dot(velocity_of(row.place, row.contact, velocity)) < row.contact.least;
    if (row.place.gap < kRowGap * h || meets) rows.push_back(std::move(row));
  }
  recall(state, static_cast<std::int32_t>(l), step.dt, rows);
  return rows;
}

void visit_fold_gaps(const solid::SolidState& state, const solid::SolidWork& work, const VisitGap& visit) {
  const Grid& g = state.band.grid;
  const solid::FoldPlaces& places = work.fold_places;
  const grid::NodeSampler sampler(g);
  const auto velocity_at = [&](const Vec3d& x) {
    return sampler.vector(state.v, ((x - g.origin) / g.h).cast<Real>()).cast<double>().eval();
  };
  for (const NearPair& pair : work.near_folds) {
    const auto one = static_cast<std::size_t>(pair.one), other = static_cast<std::size_t>(pair.other);
    const Vec3d &a = places.place[one], &b = places.place[other], way = b - a;
    if (!(places.normal[one].cast<double>().dot(way) > 0.0 && places.normal[other].cast<double>().dot(way) < 0.0))
      continue;
    visit(static_cast<double>(pair.distance) - stand_off(static_cast<double>(pair.at_rest), g.h),
          way.normalized().dot(velocity_at(a) - velocity_at(b)));
  }
}

}  // namespace efsi::sim
