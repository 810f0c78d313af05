// Purpose: the distance to a mesh, triangle by triangle.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/triangle_mesh.hpp"

namespace efsi::test {

using geometry::Triangle;
using geometry::TriangleMesh;

inline double distance_to_segment(const Vec3d& X, const Vec3d& a, const Vec3d& b) {
  const double t = std::clamp((X - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (X - a - t * (b - a)).norm();
}

// Distance from X to the nearest triangle.
inline double plain_distance(const TriangleMesh& mesh, const Vec3d& X) {
  double least = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles) {
    const Vec3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
    least = std::min({least, distance_to_segment(X, a, b), distance_to_segment(X, b, c), distance_to_segment(X, c, a)});
    const Vec3d n = (b - a).cross(c - a).normalized();
    const Vec3d foot = X - n.dot(X - a) * n;
    if ((b - a).cross(foot - a).dot(n) >= 0 && (c - b).cross(foot - b).dot(n) >= 0 &&
        (a - c).cross(foot - c).dot(n) >= 0)
      least = std::min(least, std::abs(n.dot(X - a)));
  }
  return least;
}

}  // namespace efsi::test
