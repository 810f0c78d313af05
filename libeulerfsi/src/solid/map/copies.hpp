// Purpose: duplicate cells, whose material the solid has elsewhere.
// Beside folds and thin parts the extension of the map leads back into the solid, and what is torn off there carries a
// map on that covers the whole rest shape: a second solid would grow. A map is one to one; a cell that holds what
// another holds, further away than any deformation carries it, is an error of the map.
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"

namespace efsi::solid {

// What the middle of a cell holds.
struct Holding {
  Vec3d material;  // [m]
  Vec3i cell;
  bool known;  // the solid brought all data of the cell along
};

// Cells that hold within two cells' size the same as a full one elsewhere, so that the solid would be stretched by more
// than `stretch` between them, and have the weaker claim to it. The strongest have full cells of the largest part,
// connected over faces, with known data, then those of it with others, then full cells of other parts. Cells that are
// not full claim as the largest part does, and take nothing from others. full: per cell.
std::vector<std::size_t> find_copies(const Parallel& parallel, const grid::Grid& g,
                                     const std::vector<std::vector<Holding>>& planes,
                                     const std::vector<std::uint8_t>& full, double stretch);

}  // namespace efsi::solid
