#include "record/contact_record.hpp"

#include <algorithm>

#include "contact/solid_contact.hpp"

namespace efsi::sim {
namespace {

bool same_parts(const std::vector<system::RowPart>& a, const std::vector<system::RowPart>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const system::RowPart& one, const system::RowPart& two) {
    return one.unknown == two.unknown && one.weight == two.weight;
  });
}

}  // namespace

// Penalties are in the order of the rows, of which some are open.
std::vector<Vec3d> coupling_impulses(const VelocityEquation& elasticity, const PressureEquation& pressure) {
  const std::vector<system::ContactRow>& rows = elasticity.contacts.rows;
  std::vector<Vec3d> impulses(rows.size(), Vec3d::Zero());
  if (pressure.coupled == 0) return impulses;
  const std::vector<system::Penalty>& penalties = elasticity.system.penalties();
  std::size_t p = 0;
  for (std::size_t r = 0; r < rows.size() && p < penalties.size(); ++r) {
    if (!same_parts(rows[r].parts, penalties[p].parts)) continue;
    impulses[r] = (pressure.coupled * pressure.answers[p]).cast<double>();
    ++p;
  }
  return impulses;
}

ContactPairs record_contacts(const Scene& scene, const SolidStates& states, const SolidContacts& contacts,
                             const std::vector<Vec3d>& coupling) {
  ContactPairs pairs;
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    const system::ContactRow& row = contacts.rows[r];
    const RowPlace& place = contacts.places[r];
    ContactPair& pair = find_pair(pairs, place.solids[0], place.solids[1]);
    ++pair.rows;
    pair.row_overlap = std::max(pair.row_overlap, -place.gap / scene.grid.h);
    if (place.is_fold())
      pair.surface_overlap = std::max(pair.surface_overlap, -(place.gap + place.skin) / scene.grid.h);
    if (!(row.normal_impulse > 0.0)) continue;
    ++pair.active_rows;
    pair.sticking_rows += row.sticks;
    pair.normal_impulse += row.normal_impulse + row.normal.dot(coupling[r]);
    if (!place.is_fold()) pair.impulse += row.impulse() + coupling[r];
  }
  std::erase_if(pairs, [](const ContactPair& pair) { return pair.active_rows == 0; });
  for (ContactPair& pair : pairs) {
    pair.steps = 1;
    if (pair.one == pair.other) continue;
    const double gap = least_gap(scene, states, pair.one, pair.other) / scene.grid.h;
    pair.surface_overlap = std::max(pair.row_overlap, -gap) - kContactSkin;
  }
  return pairs;
}

void add_contacts(const ContactPairs& later, ContactPairs& sums) {
  for (const ContactPair& more : later) {
    ContactPair& pair = find_pair(sums, more.one, more.other);
    pair.steps += more.steps;
    pair.rows += more.rows;
    pair.active_rows += more.active_rows;
    pair.sticking_rows += more.sticking_rows;
    pair.row_overlap = std::max(pair.row_overlap, more.row_overlap);
    pair.surface_overlap = std::max(pair.surface_overlap, more.surface_overlap);
    pair.normal_impulse += more.normal_impulse;
    pair.impulse += more.impulse;
    if (pair.exchanged_vertices == 0) pair.exchanged_place = more.exchanged_place;
    pair.exchanged_vertices += more.exchanged_vertices;
    if (!pair.passed) pair.passed = more.passed;
  }
}

}  // namespace efsi::sim
