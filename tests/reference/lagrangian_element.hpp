// Purpose: slow twin of an element: energy and force of a hexahedron whose nodes move while their material points stay.
// Paper: Sec. 4.4, Eq. 9, 10. With X_a = x_a - u_a, F = (sum_a x_a dN_a/dxi^T) (sum_a X_a dN_a/dxi^T)^-1 and
// f_a = -dW/dx_a, W = sum over points of psi(F) det(dX/dxi) / points.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "grid/grid.hpp"
#include "material/constitutive.hpp"

namespace efsi::reference {

using Corners = std::array<Vec3d, 8>;

struct LagrangianElement {
  material::Elastic elastic;
  int points = 8;
  Corners material;  // X_a

  // Derivatives of the shape functions on the unit cube.
  static Corners gradients(const Vec3d& xi) {
    Corners g;
    for (std::size_t a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i) {
        g[a][i] = grid::kCorner[a][i] ? 1.0 : -1.0;
        for (int j = 0; j < 3; ++j)
          if (j != i) g[a][i] *= grid::kCorner[a][j] ? xi[j] : 1.0 - xi[j];
      }
    return g;
  }
  Vec3d point(int q) const {
    if (points == 1) return Vec3d::Constant(0.5);
    Vec3d xi;
    for (int i = 0; i < 3; ++i) xi[i] = 0.5 + (grid::kCorner[q][i] ? 0.5 : -0.5) / std::sqrt(3.0);
    return xi;
  }

  // Energy and forces -dW/dx_a at node positions x.
  double energy(const Corners& x, Corners* force = nullptr) const {
    double total = 0.0;
    if (force) force->fill(Vec3d::Zero());
    for (int q = 0; q < points; ++q) {
      const Corners g = gradients(point(q));
      Mat3d dx = Mat3d::Zero(), dX = Mat3d::Zero();
      for (std::size_t a = 0; a < 8; ++a) {
        dx += x[a] * g[a].transpose();
        dX += material[a] * g[a].transpose();
      }
      const Mat3d inverse = dX.inverse();
      const double volume = dX.determinant() / points;
      const Eigen::JacobiSVD<Mat3d> svd(dx * inverse, Eigen::ComputeFullU | Eigen::ComputeFullV);
      const material::PrincipalResponse r = material::principal_response(elastic, svd.singularValues());
      total += r.energy * volume;
      if (!force) continue;
      const Mat3d stress = svd.matrixU() * r.stress.asDiagonal() * svd.matrixV().transpose();
      for (std::size_t a = 0; a < 8; ++a) (*force)[a] -= volume * stress * (inverse.transpose() * g[a]);
    }
    return total;
  }
};

}  // namespace efsi::reference
