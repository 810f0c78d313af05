// Purpose: the six tetrahedra of Kuhn that fill a grid cell, alike in all cells, so that they meet face to face.
#pragma once

#include <array>

namespace efsi::geometry {

// Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Each tetrahedron follows a path of cell edges from corner
// 0 to corner 7.
inline constexpr std::array<std::array<int, 4>, 6> kKuhnTetrahedra = {
    {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}}};

}  // namespace efsi::geometry
