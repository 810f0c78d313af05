#include "contact/given_rows.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "given/prescribed.hpp"

namespace efsi::sim {
namespace {

constexpr double kFreePart =
    0.5;  // of a contact's weights on one of its sides: with less on free nodes that side is prescribed

}  // namespace

void keep_prescribed(const std::vector<PrescribedNode>& given, std::vector<WallRow>& walls, NodeVelocity& velocity) {
  if (given.empty()) return;
  std::set<std::pair<std::size_t, std::size_t>> nodes;
  for (const PrescribedNode& g : given) nodes.insert({g.solid, g.node});
  std::erase_if(walls, [&](const WallRow& row) {
    return nodes.contains({row.solid, row.node}) || nodes.contains({row.solid, row.above});
  });
  restore_given(given, velocity);
}

void drop_blocked_rows(const std::vector<PrescribedNode>& given, const system::VelocitySystem& system,
                       SolidContacts& contacts) {
  if (given.empty()) return;
  const auto blocked = [&](const system::ContactRow& row) {
    double free[2] = {0.0, 0.0};  // part of a side's weights, which add up to 1, on nodes that move
    for (std::size_t i = 0; i < row.parts.size(); ++i) {
      const system::RowPart& part = row.parts[i];
      const std::size_t side = 2 * i / row.parts.size();
      const double weight = static_cast<double>(part.weight) * (side == 0 ? -1.0 : 1.0);
      if (system.moves()[3 * part.unknown] > 0 || system.moves()[3 * part.unknown + 1] > 0 ||
          system.moves()[3 * part.unknown + 2] > 0)
        free[side] += weight;
    }
    return std::max(free[0], free[1]) < kFreePart;
  };
  std::size_t kept = 0;
  for (std::size_t r = 0; r < contacts.rows.size(); ++r) {
    if (blocked(contacts.rows[r])) continue;
    if (kept != r) {
      contacts.rows[kept] = std::move(contacts.rows[r]);
      contacts.places[kept] = contacts.places[r];
    }
    ++kept;
  }
  contacts.rows.resize(kept);
  contacts.places.resize(kept);
}

}  // namespace efsi::sim
