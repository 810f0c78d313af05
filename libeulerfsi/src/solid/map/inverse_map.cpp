#include "solid/map/inverse_map.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

namespace efsi::solid {
namespace {

constexpr int kNewtonIterations = 8;
constexpr double kNewtonTolerance = 1e-4;  // cells

}  // namespace

std::size_t lower_node(const Grid& g, const Vec3d& x, double f[3]) {
  const Vec3d p = (x - g.origin) / g.h;
  int lower[3];
  for (int a = 0; a < 3; ++a) {
    const int n = g.cells[static_cast<std::size_t>(a)];
    const double q = std::clamp(p[a], 0.0, static_cast<double>(n));
    lower[a] = std::min(static_cast<int>(q), n - 1);
    f[a] = p[a] - lower[a];  // extrapolates linearly beyond the band
  }
  return g.node(lower[0], lower[1], lower[2]);
}

bool sample_displacement(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& x, Vec3d& u,
                         Mat3d& gradient) {
  const Grid& g = state.band.grid;
  double f[3];
  const std::size_t base = lower_node(g, x, f);
  u.setZero();
  gradient.setZero();
  for (std::size_t a = 0; a < 8; ++a) {
    if (!state.valid[base + corner[a]]) return false;
    double w[3], s[3];
    for (int i = 0; i < 3; ++i) {
      w[i] = grid::kCorner[a][i] ? f[i] : 1.0 - f[i];
      s[i] = grid::kCorner[a][i] ? 1.0 : -1.0;
    }
    const Vec3d value = state.u.at(base + corner[a]).cast<double>();
    u += w[0] * w[1] * w[2] * value;
    gradient += value * Vec3d(s[0] * w[1] * w[2], w[0] * s[1] * w[2], w[0] * w[1] * s[2]).transpose() / g.h;
  }
  return true;
}

double correct_point(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& material,
                     Vec3d& best_x) {
  const double h = state.band.grid.h;
  Vec3d x = best_x;
  double best = std::numeric_limits<double>::infinity();
  for (int it = 0; it < kNewtonIterations; ++it) {
    Vec3d u;
    Mat3d gradient;
    if (!sample_displacement(state, corner, x, u, gradient)) break;
    const Vec3d error = x - u - material;
    const double size = error.norm();
    if (size < best) {
      best = size;
      best_x = x;
    }
    if (size < kNewtonTolerance * h) break;
    const Mat3d inverse_f = Mat3d::Identity() - gradient;
    Vec3d move = error;
    if (inverse_f.determinant() > 0.05) move = inverse_f.inverse() * error;
    const double length = move.norm();
    if (length > h) move *= h / length;
    x -= move;
  }
  return best;
}

}  // namespace efsi::solid
