// Purpose: a signed distance field on the nodes of a dense regular grid in material space.
// phi < 0 inside the solid, > 0 outside [m]; X is a point of material space [m].
#pragma once

#include <cstddef>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::geometry {

struct SignedDistance {
  Vec3i size = {0, 0, 0};        // nodes along x, y, z; at least 2 each
  double spacing = 0.0;          // between nodes [m]
  Vec3d origin = Vec3d::Zero();  // of node (0, 0, 0) [m]
  std::vector<float> values;     // phi of node (i, j, k) at i + size[0] * (j + size[1] * k) [m]
  int flat = -1;                 // axis along which phi does not change, wherever X is; -1: none

  std::size_t index(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size[0]) * (j + static_cast<std::size_t>(size[1]) * k);
  }
  Vec3d node(int i, int j, int k) const { return origin + spacing * Vec3d(i, j, k); }

  // phi at X: trilinear inside the grid; outside, the value at the nearest point of the grid plus the distance to it,
  // which is continuous and positive.
  double sample(const Vec3d& X) const;

  // grad phi at X: central differences of sample() over one spacing; continuous.
  Vec3d gradient(const Vec3d& X) const;

  // Volume of phi < 0 [m^3]: exact for the piecewise linear interpolant on six tetrahedra per cell.
  double volume() const;
};

}  // namespace efsi::geometry
