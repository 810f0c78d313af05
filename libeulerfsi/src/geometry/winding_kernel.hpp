// Purpose: sums of winding numbers over triangles and groups of them at many points at once, and their interpolation.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "base/kernel.hpp"
#include "base/math_types.hpp"

namespace efsi::geometry {

// Coefficients of x^3, y^3, z^3, x^2 y, x^2 z, y^2 x, y^2 z, z^2 x, z^2 y, x y z.
using CubicForm = std::array<double, 10>;

EFSI_INLINE double cubic_form(const CubicForm& c, double x, double y, double z) {
  return x * x * (c[0] * x + c[3] * y + c[4] * z) + y * y * (c[1] * y + c[5] * x + c[6] * z) +
         z * z * (c[2] * z + c[7] * x + c[8] * y) + c[9] * x * y * z;
}

// Winding numbers at points; the terms are added in the order of the calls.
class WindingSum {
 public:
  // centre: near the points; coordinates are taken from there.
  WindingSum(const Vec3d& centre, const std::vector<Vec3d>& points);

  // A triangle, exactly.
  void add_near(const Vec3d& a, const Vec3d& b, const Vec3d& c);
  // A far group of triangles by three terms of the Taylor series of its dipole field, as in TriangleTree.
  void add_far(const Vec3d& middle, const Vec3d& area_normal, const Mat3d& moment, const CubicForm& second_moment);
  // Adds the sums to what is there; on_surface: rounding decides on which side of a triangle the point lies.
  void add_to(std::vector<double>& winding, std::vector<bool>& on_surface) const;

 private:
  std::size_t count_, padded_;
  Vec3d centre_;
  std::vector<double> x_, y_, z_, near_, far_, flat_;
};

// Interpolation of fourth order in a cube between 4 x 4 x 4 Chebyshev points.
class CubeInterpolation {
 public:
  static std::vector<Vec3d> support(const Vec3d& centre, double half);
  // values: at the support points.
  CubeInterpolation(const Vec3d& centre, double half, const std::vector<double>& values);
  double at(const Vec3d& X) const;

 private:
  Vec3d centre_;
  double half_;
  std::array<double, 64> values_;
};

}  // namespace efsi::geometry
