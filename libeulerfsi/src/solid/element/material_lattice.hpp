// Purpose: a lattice of nodes in the rest shape of a solid, for what belongs to its material: material does not move in
// it, so that no transport blurs it.
#pragma once

#include "grid/grid.hpp"

namespace efsi::solid {

// Spacing h; covers `low` to `high`, the extent of the rest shape [m], and a cell more.
grid::Grid make_material_lattice(const Vec3d& low, const Vec3d& high, double h);

// The nodes of a lattice around a point of the material, and their trilinear weights.
struct LatticePoint {
  std::size_t node[8];
  double weight[8];
};
// X [m]; beyond the lattice its nearest point.
LatticePoint lattice_point(const grid::Grid& lattice, const Vec3d& X);

}  // namespace efsi::solid
