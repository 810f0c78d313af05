// Purpose: the triangle that is nearest to a point, against a look at all of them.
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "geometry/nearest_triangle.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;

TEST_CASE("The nearest point of a triangle lies over its face, an edge or a corner") {
  const Vec3d a(0, 0, 0), b(2, 0, 0), c(0, 2, 0);
  const auto at = [&](const Vec3d& x) { return geometry::closest_point(a, b, c, x); };
  CHECK((at({0.5, 0.5, 3}) - Vec3d(0.5, 0.5, 0)).norm() < 1e-15);
  CHECK((at({0.5, 0.5, -3}) - Vec3d(0.5, 0.5, 0)).norm() < 1e-15);
  CHECK((at({1, -1, 1}) - Vec3d(1, 0, 0)).norm() < 1e-15);
  CHECK((at({2, 2, 0}) - Vec3d(1, 1, 0)).norm() < 1e-15);
  CHECK((at({-1, -2, 5}) - a).norm() < 1e-15);
  CHECK((at({4, -1, 0}) - b).norm() < 1e-15);
  // Without area it is a segment, without length a point.
  CHECK((geometry::closest_point(a, b, a, {1, 1, 0}) - Vec3d(1, 0, 0)).norm() < 1e-15);
  CHECK((geometry::closest_point(a, a, a, {1, 1, 0}) - a).norm() == 0.0);
}

TEST_CASE("The tree finds the triangle that a look at all of them finds") {
  const geometry::TriangleMesh mesh = geometry::shapes::sphere(0.7, 12, Vec3d(0.1, -0.2, 0.3));
  const geometry::NearestTriangle nearest(mesh);
  std::mt19937 random(7);
  const auto number = [&] { return static_cast<double>(random() >> 8) / 8388608.0 - 1.0; };
  for (int n = 0; n < 500; ++n) {
    const Vec3d x(number(), number(), number());
    double least = std::numeric_limits<double>::infinity();
    std::int32_t first = -1;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& c = mesh.triangles[t];
      const auto corner = [&](std::size_t i) { return mesh.points[static_cast<std::size_t>(c[i])]; };
      const double distance = (geometry::closest_point(corner(0), corner(1), corner(2), x) - x).squaredNorm();
      if (!(distance < least)) continue;
      least = distance;
      first = static_cast<std::int32_t>(t);
    }
    const auto found = nearest.find(x);
    CHECK(found.triangle == first);
    CHECK(found.distance == Approx(std::sqrt(least)));
  }
  CHECK(geometry::NearestTriangle().find({0, 0, 0}).triangle == -1);
}
