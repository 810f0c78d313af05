// Purpose: winding numbers at nodes and points against a plain sum over all triangles, for every kind of mesh.
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "geometry/distance_to_mesh.hpp"
#include "geometry/mesh_topology.hpp"
#include "geometry/winding_field.hpp"
#include "reference/plain_winding.hpp"
#include "unit/geometry/grids.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

SignedDistance distances_over(const TriangleMesh& mesh, double spacing) {
  SignedDistance grid = grid_over(mesh, spacing);
  DistanceToMesh(mesh, grid).measure(grid);
  return grid;
}

TriangleMesh leaves(int count) {
  std::mt19937 random(3);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  TriangleMesh mesh;
  for (int leaf = 0; leaf < count; ++leaf) {
    const Vec3d place(unit(), unit(), unit()), u = 0.2 * Vec3d(unit(), unit(), unit() - 0.5);
    const Vec3d v = 0.2 * Vec3d(unit() - 0.5, unit(), unit());
    mesh = shapes::together(mesh, {{place, place + u, place + u + v, place + v}, {{0, 1, 2}, {0, 2, 3}}});
  }
  return mesh;
}

std::vector<TriangleMesh> meshes_of_every_kind() {
  const TriangleMesh ball = shapes::sphere(0.4, 8), box = shapes::box({0, 0, 0}, {1, 0.5, 0.5});
  return {ball,
          box,
          shapes::box({0, 0, 0}, {1, 0.5, 0.5}, true),
          shapes::together(ball, shapes::inside_out(shapes::sphere(0.2, 6))),
          shapes::together(ball, shapes::box({0.1, -0.2, -0.2}, {0.9, 0.3, 0.3})),
          shapes::together(shapes::bowl(8, {0, 0, 0}), shapes::bowl(8, {0.3, 0.1, 0})),
          shapes::together(ball, leaves(40)),
          leaves(60)};
}

}  // namespace

TEST_CASE("Winding numbers at nodes are those of a plain sum", "[law]") {
  for (const TriangleMesh& mesh : meshes_of_every_kind()) {
    const SignedDistance distance = distances_over(mesh, 0.05);
    const TriangleTree tree(mesh);
    const WindingField field(mesh, tree, distance);
    CHECK(field.balanced() == (analyse_topology(mesh).unbalanced_edges == 0));
    double worst = 0.0;
    for (int k = 0; k < distance.size[2]; ++k) {
      for (int j = 0; j < distance.size[1]; ++j) {
        for (int i = 0; i < distance.size[0]; ++i) {
          const std::size_t at = distance.index(i, j, k);
          if (distance.values[at] < 1e-3 * distance.spacing) continue;  // on the surface
          const double exact = test::plain_winding_number(mesh, distance.node(i, j, k));
          worst = std::max(worst, std::abs(field.at_nodes()[at] - exact));
        }
      }
    }
    CAPTURE(mesh.triangles.size(), field.balanced());
    CHECK(worst < (field.balanced() ? 1e-9 : 2e-3));
  }
}

TEST_CASE("Winding numbers on both sides of every triangle are those of a plain sum", "[law]") {
  for (const TriangleMesh& mesh : meshes_of_every_kind()) {
    const SignedDistance distance = distances_over(mesh, 0.05);
    const TriangleTree tree(mesh);
    const WindingField field(mesh, tree, distance);
    std::vector<Vec3d> points;
    for (const Triangle& t : mesh.triangles) {
      const Vec3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
      const Vec3d offset = 1e-3 * distance.spacing * (b - a).cross(c - a).normalized();
      for (const Vec3d& X : {Vec3d((a + b + c) / 3), Vec3d(0.6 * a + 0.3 * b + 0.1 * c)}) {
        points.push_back(X + offset);
        points.push_back(X - offset);
      }
    }
    const std::vector<float> numbers = field.at(points, Parallel(2), Progress());
    double worst = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
      worst = std::max(worst, std::abs(numbers[i] - test::plain_winding_number(mesh, points[i])));
    CAPTURE(mesh.triangles.size(), field.balanced());
    CHECK(worst < (field.balanced() ? 1e-9 : 2e-3));
  }
}

TEST_CASE("Winding numbers close behind a triangle are those in front of it and the jump", "[law]") {
  for (const TriangleMesh& mesh : meshes_of_every_kind()) {
    const SignedDistance distance = distances_over(mesh, 0.05);
    const TriangleTree tree(mesh);
    const WindingField field(mesh, tree, distance);
    double worst = 0.0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
      const Vec3d offset = 1e-3 * distance.spacing * (b - a).cross(c - a).normalized(), middle = (a + b + c) / 3;
      const double change =
          test::plain_winding_number(mesh, middle - offset) - test::plain_winding_number(mesh, middle + offset);
      worst = std::max(worst, std::abs(change - field.jump(middle + offset, middle - offset)));
      CHECK(field.jump(middle - offset, middle + offset) == -field.jump(middle + offset, middle - offset));
    }
    CAPTURE(mesh.triangles.size());
    CHECK(worst < 0.05);
  }
}

TEST_CASE("Winding numbers do not depend on the number of threads", "[law]") {
  const TriangleMesh mesh = shapes::together(shapes::sphere(0.4, 8), leaves(40));
  const SignedDistance distance = distances_over(mesh, 0.05);
  const TriangleTree tree(mesh);
  const WindingField alone(mesh, tree, distance);
  for (const int threads : {2, 3, 8}) {
    SignedDistance again = distances_over(mesh, 0.05);
    DistanceToMesh(mesh, again, Parallel(threads)).measure(again, Parallel(threads));
    CHECK(again.values == distance.values);
    CHECK(WindingField(mesh, tree, distance, Parallel(threads)).at_nodes() == alone.at_nodes());
  }
}
