// Purpose: the rows of contact between solids, and of a solid with itself.
#pragma once

#include <array>
#include <vector>

#include "system/contact_row.hpp"

namespace efsi::sim {

// Where two solids may touch (contact/solid_contact.hpp): the rows of Eq. 8, and of each the solids and the cell of the
// box. Where a solid may touch itself (contact/fold_contact.hpp) in place of the cell the two fold points, and 0.
struct RowPlace {
  std::array<std::size_t, 2> solids{};
  Vec3i cell{};
  double gap = 0.0;    // less the skin, < 0: too deep [m]
  double skin = 0.0;   // what the row keeps between the surfaces [m]
  double room = 0.0;   // beside a collider: the part of the cell that is outside it and the skin
  bool meets = false;  // active in the last step, or will be without the solids' own forces
  bool is_fold() const { return solids[0] == solids[1]; }
};
struct SolidContacts {
  std::vector<RowPlace> places;
  std::vector<system::ContactRow> rows;
  std::size_t looked = 0;  // nodes that the bands of two solids have in common, which were looked at for rows
};

}  // namespace efsi::sim
