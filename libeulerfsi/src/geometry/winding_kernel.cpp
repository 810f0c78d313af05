// Purpose: sums of winding numbers over triangles and groups of them at many points at once, and their interpolation.
#include "geometry/winding_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace efsi::geometry {

namespace {

constexpr std::size_t kLanes = 8;  // the number of points is filled up to a multiple of it
constexpr double kFlat = 1e-6;     // of the product of the distances to the corners: on the triangle

// atan2(y, x) to 1e-9, as in triangle_tree.cpp, without branches.
EFSI_INLINE double arc_tangent(double y, double x) {
  const double ax = x < 0.0 ? -x : x, ay = y < 0.0 ? -y : y;
  const double low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
  constexpr double kTangentOfEighth = 0.41421356237309503;  // tan(pi / 8)
  const bool upper = low > kTangentOfEighth * high;
  const double t = (upper ? low - high : low) / ((upper ? low + high : high) + 1e-300), s = t * t;
  double series = 1.0 / 21;
  series = 1.0 / 19 - s * series;
  series = 1.0 / 17 - s * series;
  series = 1.0 / 15 - s * series;
  series = 1.0 / 13 - s * series;
  series = 1.0 / 11 - s * series;
  series = 1.0 / 9 - s * series;
  series = 1.0 / 7 - s * series;
  series = 1.0 / 5 - s * series;
  series = 1.0 / 3 - s * series;
  series = 1.0 - s * series;
  double angle = (upper ? std::numbers::pi / 4.0 : 0.0) + t * series;
  angle = ay > ax ? std::numbers::pi / 2.0 - angle : angle;
  angle = x < 0.0 ? std::numbers::pi - angle : angle;
  return y < 0.0 ? -angle : angle;
}

struct Corner {
  double x, y, z;
};

// Adds the winding number of a triangle (van Oosterom and Strackee 1983); marks points that lie on it.
EFSI_KERNEL void add_triangle(const Corner a, const Corner b, const Corner c, std::size_t count, const double* px,
                              const double* py, const double* pz, double* winding, double* flat) {
#pragma omp simd
  for (std::size_t i = 0; i < count; ++i) {
    const double ax = a.x - px[i], ay = a.y - py[i], az = a.z - pz[i];
    const double bx = b.x - px[i], by = b.y - py[i], bz = b.z - pz[i];
    const double cx = c.x - px[i], cy = c.y - py[i], cz = c.z - pz[i];
    const double la = std::sqrt(ax * ax + ay * ay + az * az), lb = std::sqrt(bx * bx + by * by + bz * bz);
    const double lc = std::sqrt(cx * cx + cy * cy + cz * cz);
    const double numerator = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    const double ab = ax * bx + ay * by + az * bz, bc = bx * cx + by * cy + bz * cz, ca = cx * ax + cy * ay + cz * az;
    const double size = la * lb * lc, denominator = size + ab * lc + bc * la + ca * lb;
    winding[i] += arc_tangent(numerator, denominator);
    const double height = numerator < 0.0 ? -numerator : numerator;
    const double larger = height < denominator ? denominator : height;  // both small: on the triangle or its edges
    flat[i] = larger <= kFlat * size ? 1.0 : flat[i];
  }
}

// Adds the field of a group: (N . r + tr M - 3 r.M r / r^2 + C(r) / r^4) / |r|^3.
EFSI_KERNEL void add_group(const Corner middle, const Corner n, const std::array<double, 6>& m, const CubicForm& form,
                           std::size_t count, const double* px, const double* py, const double* pz, double* winding) {
  const CubicForm c = form;
  const double xx = m[0], yy = m[1], zz = m[2], xy = m[3], yz = m[4], zx = m[5], trace = xx + yy + zz;
#pragma omp simd
  for (std::size_t i = 0; i < count; ++i) {
    const double x = middle.x - px[i], y = middle.y - py[i], z = middle.z - pz[i];
    const double inverse = 1.0 / (x * x + y * y + z * z);
    const double quadratic = xx * x * x + yy * y * y + zz * z * z + xy * x * y + yz * y * z + zx * z * x;
    const double dipole = n.x * x + n.y * y + n.z * z;
    const double cubic = cubic_form(c, x, y, z) * inverse;
    winding[i] += (dipole + trace + (cubic - 3.0 * quadratic) * inverse) * (inverse * std::sqrt(inverse));
  }
}

}  // namespace

WindingSum::WindingSum(const Vec3d& centre, const std::vector<Vec3d>& points)
    : count_(points.size()), padded_((points.size() + kLanes - 1) / kLanes * kLanes), centre_(centre) {
  for (auto* coordinate : {&x_, &y_, &z_, &near_, &far_, &flat_}) coordinate->assign(padded_, 0.0);
  for (std::size_t i = 0; i < padded_; ++i) {
    const Vec3d x = points[std::min(i, count_ - 1)] - centre;
    x_[i] = x.x();
    y_[i] = x.y();
    z_[i] = x.z();
  }
}

void WindingSum::add_near(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d p = a - centre_, q = b - centre_, r = c - centre_;
  add_triangle({p.x(), p.y(), p.z()}, {q.x(), q.y(), q.z()}, {r.x(), r.y(), r.z()}, padded_, x_.data(), y_.data(),
               z_.data(), near_.data(), flat_.data());
}

void WindingSum::add_far(const Vec3d& middle, const Vec3d& area_normal, const Mat3d& m,
                         const CubicForm& second_moment) {
  const Vec3d p = middle - centre_;
  const std::array<double, 6> symmetric = {m(0, 0),           m(1, 1),           m(2, 2),
                                           m(0, 1) + m(1, 0), m(1, 2) + m(2, 1), m(2, 0) + m(0, 2)};
  add_group({p.x(), p.y(), p.z()}, {area_normal.x(), area_normal.y(), area_normal.z()}, symmetric, second_moment,
            padded_, x_.data(), y_.data(), z_.data(), far_.data());
}

void WindingSum::add_to(std::vector<double>& winding, std::vector<bool>& on_surface) const {
  for (std::size_t i = 0; i < count_; ++i) {
    winding[i] += near_[i] / (2.0 * std::numbers::pi) + far_[i] / (4.0 * std::numbers::pi);
    if (flat_[i] > 0.0) on_surface[i] = true;
  }
}

namespace {

// cos(pi / 8) and cos(3 pi / 8): the Chebyshev points of four in -1..1.
constexpr std::array<double, 4> kChebyshev = {-0.92387953251128674, -0.38268343236508978, 0.38268343236508978,
                                              0.92387953251128674};

std::array<double, 4> weights(double t) {
  std::array<double, 4> w;
  for (std::size_t i = 0; i < 4; ++i) {
    w[i] = 1.0;
    for (std::size_t j = 0; j < 4; ++j)
      if (j != i) w[i] *= (t - kChebyshev[j]) / (kChebyshev[i] - kChebyshev[j]);
  }
  return w;
}

}  // namespace

std::vector<Vec3d> CubeInterpolation::support(const Vec3d& centre, double half) {
  std::vector<Vec3d> points;
  for (const double z : kChebyshev)
    for (const double y : kChebyshev)
      for (const double x : kChebyshev) points.push_back(centre + half * Vec3d(x, y, z));
  return points;
}

CubeInterpolation::CubeInterpolation(const Vec3d& centre, double half, const std::vector<double>& values)
    : centre_(centre), half_(half) {
  std::copy_n(values.begin(), values_.size(), values_.begin());
}

double CubeInterpolation::at(const Vec3d& X) const {
  const Vec3d t = (X - centre_) / half_;
  const std::array<double, 4> u = weights(t.x()), v = weights(t.y()), w = weights(t.z());
  double sum = 0.0;
  for (std::size_t k = 0; k < 4; ++k) {
    for (std::size_t j = 0; j < 4; ++j) {
      const double* row = &values_[4 * (j + 4 * k)];
      sum += w[k] * v[j] * (u[0] * row[0] + u[1] * row[1] + u[2] * row[2] + u[3] * row[3]);
    }
  }
  return sum;
}

}  // namespace efsi::geometry
