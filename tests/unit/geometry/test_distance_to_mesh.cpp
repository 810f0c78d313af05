// Purpose: distances to the boundary of a solid that is made of parts of a mesh and caps, against a plain search.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/distance_to_mesh.hpp"
#include "geometry/solid_boundary.hpp"
#include "reference/plain_distance.hpp"
#include "unit/geometry/grids.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

std::vector<TriangleMesh> overlapping_meshes() {
  const TriangleMesh ball = shapes::sphere(0.4, 6);
  return {shapes::together(ball, shapes::sphere(0.3, 10, {0.35, 0.1, 0})),
          shapes::together(ball, shapes::box({0.1, -0.2, -0.2}, {0.9, 0.3, 0.3})), shapes::bowl(16, {0, 0, 0}),
          shapes::together(shapes::bowl(16, {0, 0, 0}), shapes::bowl(16, {0.3, 0.1, 0}))};
}

// Distance to the boundary of the solid, as build_signed_distance() makes it.
SolidBoundary measure_solid(const TriangleMesh& mesh, SignedDistance& grid, const Parallel& parallel = Parallel()) {
  DistanceToMesh distance(mesh, grid, parallel);
  distance.measure_near(grid, parallel);
  const TriangleTree tree(mesh);
  SolidBoundary boundary = solid_boundary(mesh, grid, WindingField(mesh, tree, grid, parallel), false, parallel);
  const auto same_part = [&](std::int32_t triangle, const Vec3d& X) {
    return boundary.triangle_at(mesh, grid.spacing, triangle, X);
  };
  distance.replace_mesh(boundary.mesh, boundary.kept, same_part, parallel);
  distance.measure(grid, parallel);
  return boundary;
}

}  // namespace

TEST_CASE("Distances to kept pieces and caps are those of a plain search, far away nearly", "[law][nightly]") {
  for (const TriangleMesh& mesh : overlapping_meshes()) {
    SignedDistance grid = grid_over(mesh, 0.04);
    const SolidBoundary boundary = measure_solid(mesh, grid);
    REQUIRE(boundary.differs);
    double worst_near = 0.0, worst_far = 0.0;
    for_each_node(grid, [&](const Vec3d& X, double distance) {
      const double exact = test::plain_distance(boundary.mesh, X), error = std::abs(distance - exact);
      double& worst = exact < 3.0 * grid.spacing ? worst_near : worst_far;
      worst = std::max(worst, exact < 3.0 * grid.spacing ? error / grid.spacing : error / exact);
    });
    CAPTURE(mesh.triangles.size(), boundary.kept, boundary.mesh.triangles.size());
    CHECK(worst_near < 0.01);
    CHECK(worst_far < 0.04);
  }
}

TEST_CASE("Before the boundary is known, distances are right to one and a half spacings and end at three", "[law]") {
  const TriangleMesh mesh = shapes::sphere(0.4, 8);
  SignedDistance grid = grid_over(mesh, 0.05);
  DistanceToMesh(mesh, grid).measure_near(grid);
  double worst_near = 0.0, least = 1.0, most = 0.0;
  for_each_node(grid, [&](const Vec3d& X, double distance) {
    const double exact = test::plain_distance(mesh, X);
    if (exact < 0.075) worst_near = std::max(worst_near, std::abs(distance - exact));
    if (exact >= 0.075) least = std::min(least, distance);
    most = std::max(most, distance);
  });
  CHECK(worst_near < 0.01 * grid.spacing);
  CHECK(least >= 0.0749);
  CHECK(most == Approx(0.15));
}

TEST_CASE("A point of a triangle lies on the triangle of the boundary that it is said to lie on", "[law]") {
  const TriangleMesh mesh = shapes::together(shapes::sphere(0.4, 3), shapes::sphere(0.3, 3, {0.35, 0.1, 0}));
  SignedDistance grid = grid_over(mesh, 0.04);
  const SolidBoundary boundary = measure_solid(mesh, grid);
  CHECK(boundary.inner_triangles > 0);
  int on_boundary = 0, inside = 0;
  double worst = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corner = mesh.triangles[t];
    for (int u = 0; u <= 20; ++u) {
      for (int v = 0; u + v <= 20; ++v) {
        const Vec3d X =
            (u * mesh.points[corner[1]] + v * mesh.points[corner[2]] + (20 - u - v) * mesh.points[corner[0]]) / 20;
        const std::int32_t at = boundary.triangle_at(mesh, grid.spacing, static_cast<std::int32_t>(t), X);
        CHECK(at < static_cast<std::int32_t>(boundary.kept));
        ++(at < 0 ? inside : on_boundary);
        if (at >= 0)
          worst = std::max(worst, test::plain_distance({boundary.mesh.points, {boundary.mesh.triangles[at]}}, X));
      }
    }
  }
  CHECK(on_boundary > 1000);
  CHECK(inside > 500);
  CHECK(worst < 1e-9);
}

TEST_CASE("Distances to the boundary do not depend on the number of threads", "[law]") {
  for (const TriangleMesh& mesh : overlapping_meshes()) {
    SignedDistance alone = grid_over(mesh, 0.03);
    measure_solid(mesh, alone);
    for (const int threads : {2, 3, 4, 8}) {
      SignedDistance grid = grid_over(mesh, 0.03);
      measure_solid(mesh, grid, Parallel(threads));
      CHECK(grid.values == alone.values);
    }
  }
}
