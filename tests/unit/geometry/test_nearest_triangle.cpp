// Purpose: the triangle that is nearest to a point, against a look at all of them.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
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

namespace {

geometry::NearestTriangle::Found look_at_all(const geometry::TriangleMesh& mesh, const Vec3d& x) {
  double least = std::numeric_limits<double>::infinity();
  geometry::NearestTriangle::Found first;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& c = mesh.triangles[t];
    const auto corner = [&](std::size_t i) { return mesh.points[static_cast<std::size_t>(c[i])]; };
    const double distance = (geometry::closest_point(corner(0), corner(1), corner(2), x) - x).squaredNorm();
    if (!(distance < least)) continue;
    least = distance;
    first.triangle = static_cast<std::int32_t>(t);
    first.distance = std::sqrt(least);
  }
  return first;
}

// Triangles that do not hang together: needles, segments, points and some that are large.
geometry::TriangleMesh needles(const std::function<double()>& number) {
  geometry::TriangleMesh mesh;
  for (int t = 0; t < 200; ++t) {
    const Vec3d a(number(), number(), number()), way(number(), number(), number()), side(number(), number(), number());
    const double length = t % 10 == 0 ? 1.0 : 0.1, width = std::array{1.0, 1e-3, 1e-9, 0.0}[t % 4];
    const auto first = static_cast<std::int32_t>(mesh.points.size());
    mesh.points.insert(mesh.points.end(), {a, a + length * way, a + 0.5 * length * way + length * width * side});
    mesh.triangles.push_back({first, first + 1, t % 7 == 0 ? first : first + 2});
  }
  return mesh;
}

}  // namespace

TEST_CASE("The tree finds the triangle that a look at all of them finds, to the last bit") {
  std::mt19937 random(7);
  const auto number = [&] { return static_cast<double>(random() >> 8) / 8388608.0 - 1.0; };
  for (const geometry::TriangleMesh& mesh : {geometry::shapes::sphere(0.7, 12, Vec3d(0.1, -0.2, 0.3)),
                                             geometry::shapes::box({-0.5, -0.5, -0.5}, {0.5, 1, 2}), needles(number)}) {
    const geometry::NearestTriangle nearest(mesh);
    std::vector<Vec3d> points;
    for (int n = 0; n < 500; ++n)
      points.push_back(Vec3d(number(), number(), number()) * std::array{1.0, 0.1, 1e4}[n % 3]);
    // On and close to the mesh, also where several triangles are equally near.
    for (std::size_t t = 0; t < mesh.triangles.size(); t += 5) {
      const auto& c = mesh.triangles[t];
      const Vec3d &a = mesh.points[static_cast<std::size_t>(c[0])], &b = mesh.points[static_cast<std::size_t>(c[1])];
      const Vec3d up = 1e-7 * Vec3d(number(), number(), number());
      points.insert(points.end(), {a, a + up, 0.5 * (a + b), 0.5 * (a + b) + up, 0.5 * (a + b) + 1e4 * up});
    }
    std::size_t wrong = 0;
    std::int32_t guess = -1;
    for (const Vec3d& x : points) {
      const auto wanted = look_at_all(mesh, x), found = nearest.find(x), guessed = nearest.find(x, guess);
      wrong += found.triangle != wanted.triangle || found.distance != wanted.distance;
      wrong += guessed.triangle != wanted.triangle || guessed.distance != wanted.distance;
      guess = found.leaf;
    }
    CHECK(wrong == 0);
  }
  CHECK(geometry::NearestTriangle().find({0, 0, 0}).triangle == -1);
}
