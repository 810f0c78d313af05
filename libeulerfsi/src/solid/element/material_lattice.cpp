#include "solid/element/material_lattice.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::solid {

using grid::Grid;

Grid make_material_lattice(const Vec3d& low, const Vec3d& high, double h) {
  Grid lattice;
  lattice.h = h;
  lattice.origin = low - Vec3d::Constant(h);
  for (std::size_t a = 0; a < 3; ++a)
    lattice.cells[a] = 2 + static_cast<int>(std::ceil((high - low)[static_cast<Eigen::Index>(a)] / h));
  return lattice;
}

LatticePoint lattice_point(const Grid& lattice, const Vec3d& X) {
  int lower[3];
  double part[3];
  for (int a = 0; a < 3; ++a) {
    const int cells = lattice.cells[static_cast<std::size_t>(a)];
    const double x = std::clamp((X[a] - lattice.origin[a]) / lattice.h, 0.0, static_cast<double>(cells));
    lower[a] = std::min(static_cast<int>(x), cells - 1);
    part[a] = x - lower[a];
  }
  LatticePoint point;
  for (std::size_t c = 0; c < 8; ++c) {
    const auto& corner = grid::kCorner[c];
    point.node[c] = lattice.node(lower[0] + corner[0], lower[1] + corner[1], lower[2] + corner[2]);
    point.weight[c] = 1.0;
    for (int a = 0; a < 3; ++a) point.weight[c] *= corner[a] ? part[a] : 1.0 - part[a];
  }
  return point;
}

}  // namespace efsi::solid
