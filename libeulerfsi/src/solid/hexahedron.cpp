#include "solid/hexahedron.hpp"

#include <cmath>

namespace efsi::solid {
namespace {

// Local coordinates in [0, 1].
ShapeGradients gradients_at(double x, double y, double z) {
  ShapeGradients g;
  for (std::size_t a = 0; a < 8; ++a) {
    const int* c = grid::kCorner[a];
    const double fx = c[0] ? x : 1 - x, fy = c[1] ? y : 1 - y, fz = c[2] ? z : 1 - z;
    const double sx = c[0] ? 1 : -1, sy = c[1] ? 1 : -1, sz = c[2] ? 1 : -1;
    g[a] = Vec3d(sx * fy * fz, fx * sy * fz, fx * fy * sz);
  }
  return g;
}

}  // namespace

const ShapeGradients& center_gradients() {
  static const ShapeGradients gradients = gradients_at(0.5, 0.5, 0.5);
  return gradients;
}

const std::array<ShapeGradients, 8>& gauss_gradients() {
  static const std::array<ShapeGradients, 8> gradients = [] {
    std::array<ShapeGradients, 8> points;
    const double low = 0.5 - 0.5 / std::sqrt(3.0), high = 0.5 + 0.5 / std::sqrt(3.0);
    for (std::size_t q = 0; q < 8; ++q) {
      const int* c = grid::kCorner[q];
      points[q] = gradients_at(c[0] ? high : low, c[1] ? high : low, c[2] ? high : low);
    }
    return points;
  }();
  return gradients;
}

}  // namespace efsi::solid
