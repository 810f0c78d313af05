// Purpose: rows of contact at what is given: walls do nothing there, and between two given motions nothing can give
// way.
#pragma once

#include <vector>

#include "contact/solid_contacts.hpp"
#include "contact/wall_row.hpp"
#include "given/given_node.hpp"
#include "nodes/node_fields.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// After meet_walls: walls do nothing at given nodes, which get back what is given.
void keep_prescribed(const std::vector<PrescribedNode>& given, std::vector<WallRow>& walls, NodeVelocity& velocity);
// Contact between what is given on both sides, or nearly: nothing can make up for it. Such rows go.
void drop_blocked_rows(const std::vector<PrescribedNode>& given, const system::VelocitySystem& system,
                       SolidContacts& contacts);

}  // namespace efsi::sim
