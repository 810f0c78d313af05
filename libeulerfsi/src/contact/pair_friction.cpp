#include "contact/pair_friction.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "grid/interpolate.hpp"

namespace efsi::sim {
namespace {

// What the closed rows between two bodies exert in the step, on the second.
struct PairContact {
  double mu = 0.0;
  double normal = 0.0;             // sum of the impulses along the rows' normals that push [kg m/s]
  double tension = 0.0;            // of those that pull, > 0 [kg m/s]
  Vec3d push = Vec3d::Zero();      // the first as a vector
  Vec3d pull = Vec3d::Zero();      // the second
  Vec3d friction = Vec3d::Zero();  // impulse across the normals
  Vec3d couple = Vec3d::Zero();    // of it, which acts at a point of each surface [kg m^2/s]
  double weight = 0.0;             // of the means below: the normal impulses before the pressure
  Vec3d first = Vec3d::Zero();     // of the places

  // The part of the friction with which the whole is in the cone of mu.
  double allowed() const {
    const double t = friction.squaredNorm(), along = push.dot(friction);
    if (!(t > 0.0)) return 1.0;
    const double room = (1.0 + mu * mu) * normal * normal - push.squaredNorm();
    const double whole = (std::sqrt(std::max(0.0, along * along + t * room)) - along) / t;
    return std::clamp(std::min(mu * normal / std::sqrt(t), whole), 0.0, 1.0);
  }
};

using Pairs = std::map<std::pair<std::size_t, std::size_t>, PairContact>;

Pairs sum_rows(const grid::Grid& box, const SolidContacts& contacts, const std::vector<Vec3d>& coupling) {
  Pairs pairs;
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    const system::ContactRow& row = contacts.rows[r];
    const RowPlace& place = contacts.places[r];
    if (place.is_fold() || !(row.normal_impulse > 0.0)) continue;
    PairContact& pair = pairs[{place.solids[0], place.solids[1]}];
    const double added = row.normal.dot(coupling[r]);
    pair.mu = row.friction;
    const double normal = row.normal_impulse + added;
    (normal > 0.0 ? pair.normal : pair.tension) += std::abs(normal);
    (normal > 0.0 ? pair.push : pair.pull) += normal * row.normal;
    const Vec3d friction = row.friction_impulse + coupling[r] - added * row.normal;
    pair.friction += friction;
    pair.couple += (place.gap + place.skin) * row.normal.cross(friction);
    pair.weight += row.normal_impulse;
    const Vec3d corner = box.node_position(place.cell[0], place.cell[1], place.cell[2]);
    pair.first += row.normal_impulse * (corner + Vec3d::Constant(0.5 * box.h));
  }
  return pairs;
}

// What a collider's motion is given by exerts on it, so that it does not feel an impulse at x.
void answer(const StepContext& step, const SolidStates& states, std::size_t l, const Vec3d& x, const Vec3d& impulse) {
  const grid::Grid& band = states[l].band.grid;
  const Vec3 velocity = grid::NodeSampler(band).vector(states[l].v, ((x - band.origin) / band.h).cast<Real>());
  for (std::size_t p = 0; p < step.scene.pins.size(); ++p)
    if (step.scene.pins[p].solid == l) step.info.pins[p].add(x, -impulse, velocity.cast<double>());
}

// Half of what the centre of the second of two bodies moves from that of the first in the step; the place at which they
// touch moves with both. Nothing where one has no mass of its own.
Vec3d half_parting(const StepContext& step, const solid::Momenta& first, const solid::Momenta& second) {
  if (!(first.mass > 0.0 && second.mass > 0.0)) return Vec3d::Zero();
  return 0.5 * step.dt * (second.linear / second.mass - first.linear / first.mass);
}

// Whether nothing but each other and what moves with them turns two bodies; in a fluid, that does too.
bool keep_spin(const StepContext& step, const Holds& holds, const std::pair<std::size_t, std::size_t>& solids) {
  const auto pinned = [&](std::size_t l) { return is_pinned(step.scene.pins, l); };
  return !step.scene.params.fluid.present && holds.clusters[holds.cluster_of[solids.first]].floats() &&
         !pinned(solids.first) && !pinned(solids.second);
}

}  // namespace

void limit_pair_friction(const StepContext& step, const SolidStates& states, const Holds& holds,
                         const SolidContacts& contacts, const std::vector<Vec3d>& coupling,
                         const std::vector<solid::Momenta>& momenta, std::vector<RigidImpulse>& impulses) {
  for (const auto& [solids, pair] : sum_rows(step.scene.grid, contacts, coupling)) {
    const auto [one, other] = solids;
    if (!pair.couple.isZero(0) && keep_spin(step, holds, solids)) {
      impulses.resize(momenta.size());
      for (const std::size_t l : {one, other}) impulses[l].angular -= 0.5 * pair.couple;
    }
    const double allowed = pair.allowed();
    if (allowed == 1.0 && pair.tension == 0.0) continue;
    const Vec3d excess = (1.0 - allowed) * pair.friction + pair.pull, x = pair.first / pair.weight;
    impulses.resize(momenta.size());
    const Vec3d parts = half_parting(step, momenta[one], momenta[other]);
    const std::tuple<std::size_t, Vec3d, Vec3d> sides[] = {{one, excess, parts}, {other, -excess, -parts}};
    for (const auto& [l, impulse, moved] : sides) {
      if (is_collider(step.scene.pins, l)) {
        answer(step, states, l, x, impulse);
      } else if (momenta[l].mass > 0.0) {
        impulses[l].add(x - momenta[l].center + moved, impulse);
      }
    }
    ContactPair& record = find_pair(step.info.contacts, solids.first, solids.second);
    record.impulse -= excess;
    record.normal_impulse += pair.tension;
  }
}

}  // namespace efsi::sim
