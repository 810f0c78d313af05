#include "contact/solid_contact.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "contact/fold_contact.hpp"
#include "contact/push_out.hpp"
#include "contact/row_parts.hpp"
#include "grid/interpolate.hpp"
#include "grid/plane_cut.hpp"
#include "solid/map/boundary_distance.hpp"
#include "solid/map/credible.hpp"
#include "solid/map/inverse_map.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kReach = 1.0;  // cells: rows from this gap on
constexpr double kFan =
    0.01;  // 1 less the square of the mean of the normals in a cell, of a surface of middling curvature
constexpr double kSought = 2.0;  // cells: farther from a vertex a surface is where the map around the vertex has it
constexpr double kFacing = 0.5;  // least cosine between the normal of a surface and that of the other turned round

// What two bands have in common, in cells of the box.
struct Overlap {
  Vec3i low, high;
  bool any() const { return low[0] < high[0] && low[1] < high[1] && low[2] < high[2]; }
};
Overlap overlap(const Grid& one, const Grid& other) {
  Overlap o;
  for (std::size_t a = 0; a < 3; ++a) {
    o.low[a] = std::max(one.lo[a], other.lo[a]);
    o.high[a] = std::min(one.lo[a] + one.cells[a], other.lo[a] + other.cells[a]);
  }
  return o;
}

// The gradient of the distance of the rest shape, seen where the material is now, at a node of the band.
Vec3d seen_gradient(const solid::SolidRest& rest, const solid::SolidState& state, const Vec3i& node) {
  const Grid& g = state.band.grid;
  const std::size_t n = g.node(node[0], node[1], node[2]);
  Mat3d inverse_f = Mat3d::Identity();
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t stride = g.node_stride(static_cast<int>(a));
    const bool behind = node[a] > 0 && state.valid[n - stride], ahead = node[a] < g.cells[a] && state.valid[n + stride];
    const std::size_t low = behind ? n - stride : n, high = ahead ? n + stride : n;
    if (low == high) continue;
    inverse_f.col(static_cast<Eigen::Index>(a)) -=
        (state.u.at(high) - state.u.at(low)).cast<double>() / (g.h * (behind && ahead ? 2.0 : 1.0));
  }
  return inverse_f.transpose() *
         solid::distance_of(rest, state)
             .gradient(g.node_position(node[0], node[1], node[2]) - state.u.at(n).cast<double>());
}

// How far the surface of a solid is from the nodes of an overlap [m], and the direction out of it; far away and where
// the solid's map is not known: kUnknown.
constexpr double kUnknown = 1e30;
struct Sight {
  std::vector<double> distance;
  std::vector<double>
      length;  // of the gradient of the distance at rest, bounded: a first estimate, `boundary_distance`
  std::vector<Vec3d> outwards;
};
Sight look(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state, const Grid& nodes) {
  constexpr double kFar = 4.0;  // cells
  const Grid& g = state.band.grid;
  const Vec3i lo = grid::offset(nodes, g);
  const geometry::SignedDistance& from = solid::distance_of(rest, state);
  Sight sight;
  sight.distance.assign(nodes.node_count(), kUnknown);
  sight.length.assign(nodes.node_count(), 1.0);
  sight.outwards.assign(nodes.node_count(), Vec3d::Zero());
  parallel.for_each(nodes.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= nodes.cells[1]; ++j)
      for (int i = 0; i <= nodes.cells[0]; ++i) {
        const Vec3i at{i + lo[0], j + lo[1], k + lo[2]};
        const std::size_t n = g.node(at[0], at[1], at[2]);
        if (state.valid[n] == solid::kNoData) continue;
        const double distance = from.sample(g.node_position(at[0], at[1], at[2]) - state.u.at(n).cast<double>());
        if (std::abs(distance) > solid::kSurfaceStretch.most * kFar * g.h) continue;
        const solid::SeenBoundary seen =
            solid::see_boundary(distance, seen_gradient(rest, state, at), solid::kSurfaceStretch);
        if (seen.outwards.isZero()) continue;
        const std::size_t node = nodes.node(i, j, k);
        sight.length[node] = seen.length;
        sight.distance[node] = seen.distance;
        sight.outwards[node] = seen.outwards;
      }
  });
  return sight;
}

// The middle of the points at which a function that is linear along the edges vanishes, in cells from corner 0.
std::optional<Vec3d> crossing(const std::array<double, 8>& f) {
  Vec3d sum = Vec3d::Zero();
  int count = 0;
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t b = a | (std::size_t{1} << axis);
      if (b == a || (f[a] < 0.0) == (f[b] < 0.0)) continue;
      Vec3d x(grid::kCorner[a][0], grid::kCorner[a][1], grid::kCorner[a][2]);
      x[static_cast<Eigen::Index>(axis)] += f[a] / (f[a] - f[b]);
      sum += x;
      ++count;
    }
  if (count == 0) return {};
  return Vec3d(sum / count);
}

// Two solids, and what they say of the nodes that their bands have in common.
struct Pair {
  std::size_t one, other;
  Grid nodes;
  Sight from_one, from_other;
};

// How far a point is from the surface of a solid [m], and the mean of the directions out of it around that.
struct Sighted {
  double distance = 0.0;
  Vec3d outwards = Vec3d::Zero();
};
// At x, where the corners of a cell of the pair's nodes weigh w; n: corner 0. The distance at rest is looked up there:
// between nodes it would pass over edges and corners.
Sighted sighted(const solid::SolidRest& rest, const solid::SolidState& state, const Sight& sight, std::size_t n,
                const std::array<std::size_t, 8>& corner, const Weights& w, const Vec3d& x) {
  Sighted out;
  double length = 0.0;
  for (std::size_t c = 0; c < 8; ++c) {
    length += w[c] * sight.length[n + corner[c]];
    out.outwards += w[c] * sight.outwards[n + corner[c]];
  }
  out.distance = solid::boundary_distance(rest, state, x, out.outwards.normalized(), length);
  return out;
}

// How far a surface knows its normal in a cell, by the mean of the unit normals around it: at an edge they fan out, and
// the face that it touches decides.
double certainty(const Vec3d& mean_normal) {
  const double fan = kFan + std::max(0.0, 1.0 - mean_normal.squaredNorm());
  return 1.0 / (fan * fan);
}

// The row of a cell of a pair's nodes, if the surface halfway between the solids cuts it and they are near enough.
std::optional<FoundRow> find_row(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                                 const Grid& common, const Pair& pair, const Vec3i& cell) {
  const Grid& g = pair.nodes;
  const auto corner = grid::corner_offsets(g);
  const std::size_t n = g.node(cell[0], cell[1], cell[2]);
  std::array<double, 8> difference;
  double nearest = kUnknown;
  for (std::size_t c = 0; c < 8; ++c) {
    const double a = pair.from_one.distance[n + corner[c]], b = pair.from_other.distance[n + corner[c]];
    if (a == kUnknown || b == kUnknown) return {};
    difference[c] = a - b;
    nearest = std::min(nearest, a + b);
  }
  if (nearest > (kReach + kContactSkin + std::sqrt(3.0)) * g.h) return {};  // a + b changes by 2 from place to place
  const auto place = crossing(difference);
  if (!place) return {};
  const Weights w = trilinear(*place);
  const Vec3d x = g.node_position(cell[0], cell[1], cell[2]) + g.h * *place;
  const auto see = [&](std::size_t l, const Sight& sight) {
    return sighted(step.scene.solids[l], states[l], sight, n, corner, w, x);
  };
  const Sighted one = see(pair.one, pair.from_one), other = see(pair.other, pair.from_other);
  const Vec3d &out_of_one = one.outwards, &out_of_other = other.outwards;
  const double gap = one.distance + other.distance - kContactSkin * g.h;
  if (!(gap < kReach * g.h && out_of_one.normalized().dot(out_of_other.normalized()) < -kFacing)) return {};
  const Vec3d normal = (certainty(out_of_one) * out_of_one - certainty(out_of_other) * out_of_other).normalized();
  // The part of the cell beyond the skin of a collider, whose surface is so far from x and has this normal.
  const auto room_beside = [&](double distance, const Vec3d& outwards) {
    const Vec3d middle = g.node_position(cell[0], cell[1], cell[2]) + Vec3d::Constant(0.5 * g.h);
    return grid::plane_cut_fraction(kContactSkin - (outwards.dot(middle - x) + distance) / g.h, -outwards);
  };
  double room = 0.0;
  if (is_collider(step.scene.pins, pair.one)) room = room_beside(one.distance, normal);
  if (is_collider(step.scene.pins, pair.other)) room = room_beside(other.distance, -normal);
  const Vec3i place_in_box{cell[0] + g.lo[0], cell[1] + g.lo[1], cell[2] + g.lo[2]};
  FoundRow row{{{pair.one, pair.other}, place_in_box, gap, kContactSkin * g.h, room, false}, {}};
  system::ContactRow& contact = row.contact;
  contact.normal = normal;
  contact.least = least_velocity(gap, step);
  contact.friction = 0.5 * (step.scene.solids[pair.one].friction + step.scene.solids[pair.other].friction);
  const auto add = [&](std::size_t l, double along, double sign) {
    const Vec3d end = x + along * contact.normal;
    const auto element = nearest_element(states[l].band.grid, solids[l], end, [](const Vec3i&) { return true; });
    if (!element) return false;
    add_parts(states[l].band.grid, *element, common, end, sign, contact.parts);
    return true;
  };
  if (!add(pair.one, -one.distance, -1.0) || !add(pair.other, other.distance, 1.0)) return {};
  return row;
}

// Rows of a pair in the order of their cells. Adds the nodes that it looks at.
std::vector<FoundRow> find_pair_rows(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                                     const Grid& common, std::size_t one, std::size_t other, std::size_t& looked) {
  const Grid& band = states[one].band.grid;
  const Overlap o = overlap(band, states[other].band.grid);
  if (!o.any()) return {};
  Pair pair{one, other, {}, {}, {}};
  pair.nodes.h = band.h;
  pair.nodes.lo = o.low;
  pair.nodes.cells = {o.high[0] - o.low[0], o.high[1] - o.low[1], o.high[2] - o.low[2]};
  const Vec3i lo = grid::offset(pair.nodes, band);
  pair.nodes.origin = band.node_position(lo[0], lo[1], lo[2]);
  looked += pair.nodes.node_count();
  pair.from_one = look(step.parallel, step.scene.solids[one], states[one], pair.nodes);
  pair.from_other = look(step.parallel, step.scene.solids[other], states[other], pair.nodes);
  std::vector<std::vector<FoundRow>> planes(static_cast<std::size_t>(pair.nodes.cells[2]));
  step.parallel.for_each(pair.nodes.cells[2], [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j < pair.nodes.cells[1]; ++j)
      for (int i = 0; i < pair.nodes.cells[0]; ++i)
        if (auto row = find_row(step, states, solids, common, pair, {i, j, k}))
          planes[static_cast<std::size_t>(plane)].push_back(std::move(*row));
  });
  std::vector<FoundRow> rows;
  for (auto& plane : planes)
    for (FoundRow& row : plane) rows.push_back(std::move(row));
  return rows;
}

// The impulses of the last step stand for those of this one.
void recall(const solid::SolidState& solid, double dt, std::vector<FoundRow>& rows) {
  std::map<std::array<std::int32_t, 4>, const solid::ContactImpulse*> last;
  for (const solid::ContactImpulse& p : solid.contacts) last[{p.cell[0], p.cell[1], p.cell[2], p.other}] = &p;
  for (FoundRow& row : rows) {
    Vec3i cell = row.place.cell;
    Eigen::Index axis = 0;
    row.contact.normal.cwiseAbs().maxCoeff(&axis);
    auto found = last.end();
    for (const int beside : {0, -1, 2}) {  // the cell, and those beside it along the normal
      cell[static_cast<std::size_t>(axis)] += beside;
      found = last.find({cell[0], cell[1], cell[2], static_cast<std::int32_t>(row.place.solids[1])});
      if (found != last.end()) break;
    }
    if (found == last.end()) continue;
    const solid::ContactImpulse& press = *found->second;
    row.contact.normal_impulse = dt * static_cast<double>(press.force);
    for (int a = 0; a < 3; ++a) row.contact.friction_impulse[a] = dt * static_cast<double>(press.friction_force[a]);
  }
}

}  // namespace

SolidContacts find_solid_contacts(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                                  const CommonGrid& common, const NodeVelocity& velocity) {
  SolidContacts contacts;
  if (!step.scene.params.numerics.unilateral_walls) return contacts;
  for (std::size_t one = 0; one < states.size(); ++one) {
    std::vector<FoundRow> folds = find_folds(step, one, states[one], solids[one], common.grid, velocity), rows;
    for (std::size_t other = one + 1; other < states.size(); ++other) {
      if (is_collider(step.scene.pins, one) && is_collider(step.scene.pins, other)) continue;
      for (FoundRow& row : find_pair_rows(step, states, solids, common.grid, one, other, contacts.looked))
        rows.push_back(std::move(row));
    }
    recall(states[one], step.dt, rows);
    for (auto* found : {&folds, &rows})
      for (FoundRow& row : *found) {
        contacts.places.push_back(row.place);
        contacts.rows.push_back(std::move(row.contact));
      }
  }
  if (contacts.rows.empty()) return contacts;
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    system::ContactRow& row = contacts.rows[r];
    const auto& [one, other] = contacts.places[r].solids;
    row.pair = static_cast<std::int32_t>(one * states.size() + other);
    contacts.places[r].meets =
        row.normal_impulse > 0.0 || row.normal.dot(velocity_of(contacts.places[r], row, velocity)) < row.least;
  }
  return contacts;
}

std::vector<std::uint8_t> pressed_solids(std::size_t solids, const SolidContacts& contacts) {
  std::vector<std::uint8_t> pressed(solids, 0);
  for (const auto& [one, other] : meeting_pairs(contacts)) pressed[one] = pressed[other] = 1;
  return pressed;
}

void number_rows(const system::VelocitySystem& system, SolidContacts& contacts) {
  for (std::size_t r = 0; r < contacts.rows.size(); ++r)
    for (std::size_t p = 0; p < contacts.rows[r].parts.size(); ++p) {
      std::size_t& unknown = contacts.rows[r].parts[p].unknown;
      unknown = system.unknown_of(solid_of(contacts.places[r], p), unknown);
    }
}

SolidPairs meeting_pairs(const SolidContacts& contacts) {
  SolidPairs pairs;
  for (const RowPlace& place : contacts.places)
    if (place.meets) pairs.insert({place.solids[0], place.solids[1]});
  return pairs;
}

SolidPairs active_pairs(const SolidContacts& contacts) {
  SolidPairs pairs;
  for (std::size_t r = 0; r < contacts.rows.size(); ++r)
    if (contacts.rows[r].normal_impulse > 0.0)
      pairs.insert({contacts.places[r].solids[0], contacts.places[r].solids[1]});
  return pairs;
}

void remember_contacts(double dt, const SolidContacts& contacts, SolidStates& states) {
  for (solid::SolidState& solid : states) solid.contacts.clear();
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    const system::ContactRow& row = contacts.rows[r];
    const RowPlace& place = contacts.places[r];
    if (!(row.normal_impulse > 0.0)) continue;
    const Vec3 friction = (row.friction_impulse / dt).cast<Real>();
    states[place.solids[0]].contacts.push_back({{place.cell[0], place.cell[1], place.cell[2]},
                                                static_cast<std::int32_t>(place.solids[1]),
                                                static_cast<Real>(row.normal_impulse / dt),
                                                {friction[0], friction[1], friction[2]}});
  }
}

Vec3d SeenVertex::rest_normal() const { return solid::distance_of(rest, state).gradient(material).normalized(); }

bool SeenVertex::is_known() const {
  return std::ranges::all_of(grid::corner_offsets(state.band.grid),
                             [&](std::size_t c) { return state.valid[node + c] == solid::kKnown; });
}

SeenVertex::Gap SeenVertex::gap() const {
  const Grid& g = state.band.grid;
  Vec3d u;
  Mat3d gradient;
  solid::sample_displacement(state, grid::corner_offsets(g), x, u, gradient);
  const Vec3d at_rest = solid::distance_of(rest, state).gradient(material);
  const solid::SeenBoundary seen =
      solid::see_boundary(rest_distance, at_rest - gradient.transpose() * at_rest, solid::kSurfaceStretch);
  const bool near = std::abs(rest_distance) < kSought * g.h;
  const double distance = near ? solid::boundary_distance(rest, state, x, seen.outwards, seen.length) : seen.distance;
  const auto velocity = [&](const solid::SolidState& of) {
    const Grid& band = of.band.grid;
    return Vec3d(grid::NodeSampler(band).vector(of.v, ((x - band.origin) / band.h).cast<Real>()).cast<double>());
  };
  return {distance - kContactSkin * g.h, seen.outwards.dot(velocity(state) - velocity(own))};
}

void visit_vertices(const Scene& scene, const SolidStates& states, std::size_t l, std::size_t other,
                    const VisitVertex& visit) {
  const solid::SolidState &own = states[l], &state = states[other];
  if (!overlap(own.band.grid, state.band.grid).any()) return;
  const Grid& g = state.band.grid;
  const solid::SolidRest& rest = scene.solids[other];
  const geometry::SignedDistance& distance = solid::distance_of(rest, state);
  const grid::NodeSampler sampler(g);
  const auto corner = grid::corner_offsets(g);
  for (std::size_t vertex = 0; vertex < own.surface.size(); ++vertex) {
    const Vec3d &x = own.surface[vertex], at = (x - g.origin) / g.h;
    Vec3i cell;
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      cell[a] = static_cast<int>(std::floor(at[static_cast<Eigen::Index>(a)]));
      inside = inside && cell[a] >= 0 && cell[a] < g.cells[a];
    }
    if (!inside) continue;
    const std::size_t n = g.node(cell[0], cell[1], cell[2]);
    const auto holds = [&](std::size_t offset) { return state.valid[n + offset] != solid::kNoData; };
    if (!std::all_of(corner.begin(), corner.end(), holds)) continue;
    const Vec3d material = x - sampler.vector(state.u, at.cast<Real>()).cast<double>();
    visit({own, rest, state, vertex, n, x, material, distance.sample(material)});
  }
}

void visit_gaps(const Scene& scene, const SolidStates& states, std::size_t one, std::size_t other,
                const VisitGap& visit) {
  const auto look = [&](const SeenVertex& seen) {
    const auto [gap, closing] = seen.gap();
    visit(gap, closing);
  };
  visit_vertices(scene, states, one, other, look);
  visit_vertices(scene, states, other, one, look);
}

double least_gap(const Scene& scene, const SolidStates& states, std::size_t one, std::size_t other) {
  double least = std::numeric_limits<double>::infinity();
  const auto look = [&](const SeenVertex& seen) {
    const auto [smallest, largest] = solid::kSurfaceStretch;  // strained as far as is believed it is no nearer than
    const double at_least = seen.rest_distance / (seen.rest_distance > 0.0 ? largest : smallest);
    if (at_least - kContactSkin * scene.grid.h < least) least = std::min(least, seen.gap().size);
  };
  visit_vertices(scene, states, one, other, look);
  visit_vertices(scene, states, other, one, look);
  return least;
}

double relative_speed(const SolidStates& states, std::size_t one, std::size_t other) {
  using Range = Eigen::AlignedBox3d;
  const auto range = [](const solid::SolidState& state) {
    const grid::NodeSampler sampler(state.band.grid);
    Range velocities;
    for (const Vec3d& x : state.surface)
      velocities.extend(sampler.vector(state.v, ((x - state.band.grid.origin) / state.band.grid.h).cast<Real>())
                            .cast<double>()
                            .eval());
    return velocities;
  };
  const Range a = range(states[one]), b = range(states[other]);
  return (a.max() - b.min()).cwiseMax(b.max() - a.min()).norm();
}

}  // namespace efsi::sim
