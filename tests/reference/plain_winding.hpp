// Purpose: the slow twin of geometry/winding_field: one sum over all triangles for every point.
#pragma once

#include <cmath>
#include <numbers>

#include "geometry/triangle_mesh.hpp"

namespace efsi::test {

// Solid angle of the mesh seen from X over 4 pi (van Oosterom and Strackee 1983).
inline double plain_winding_number(const geometry::TriangleMesh& mesh, const Vec3d& X) {
  double angle = 0.0;
  for (const geometry::Triangle& t : mesh.triangles) {
    const Vec3d a = mesh.points[t[0]] - X, b = mesh.points[t[1]] - X, c = mesh.points[t[2]] - X;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle / (4.0 * std::numbers::pi);
}

}  // namespace efsi::test
