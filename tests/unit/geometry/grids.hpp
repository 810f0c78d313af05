// Purpose: grids around meshes for the tests.
#pragma once

#include <cmath>

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

// Four spacings wider than the mesh on every side; without values.
inline SignedDistance grid_over(const TriangleMesh& mesh, double spacing) {
  const Extents box = extents(mesh);
  SignedDistance grid;
  grid.spacing = spacing;
  grid.origin = box.min - Vec3d::Constant(4.0 * spacing);
  for (int axis = 0; axis < 3; ++axis)
    grid.size[axis] = static_cast<int>(std::ceil((box.max[axis] - box.min[axis]) / spacing)) + 9;
  return grid;
}

// Calls visit(position, value).
template <class Visit>
void for_each_node(const SignedDistance& grid, const Visit& visit) {
  for (int k = 0; k < grid.size[2]; ++k)
    for (int j = 0; j < grid.size[1]; ++j)
      for (int i = 0; i < grid.size[0]; ++i) visit(grid.node(i, j, k), grid.values[grid.index(i, j, k)]);
}

}  // namespace efsi::geometry
