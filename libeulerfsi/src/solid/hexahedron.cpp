#include "solid/hexahedron.hpp"

#include <cmath>

namespace efsi::solid {

ShapeGradients gradients_at(const Vec3d& local) {
  ShapeGradients g;
  for (std::size_t a = 0; a < 8; ++a) {
    Vec3d side, at;
    for (int i = 0; i < 3; ++i) {
      side[i] = grid::kCorner[a][i] ? 1.0 : -1.0;
      at[i] = 0.5 * (1.0 + side[i] * local[i]);
    }
    g[a] = Vec3d(side[0] * at[1] * at[2], at[0] * side[1] * at[2], at[0] * at[1] * side[2]);
  }
  return g;
}

const ShapeGradients& center_gradients() {
  static const ShapeGradients gradients = gradients_at(Vec3d::Zero());
  return gradients;
}

Vec3d quadrature_point(int q, int points, const Vec3d& middle) {
  if (points == 1) return middle;
  const int* side = grid::kCorner[q];
  return (Vec3d(side[0], side[1], side[2]) - Vec3d::Constant(0.5)) * (2.0 / std::sqrt(3.0));
}

}  // namespace efsi::solid
