// Purpose: the tree's winding numbers and rays against sums over all triangles.
#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

#include "geometry/triangle_tree.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

double winding_by_sum(const TriangleMesh& mesh, const Vec3d& X) {
  double sum = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = mesh.points[t[0]] - X, b = mesh.points[t[1]] - X, c = mesh.points[t[2]] - X;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (2 * std::numbers::pi);
}

// Lengths along the ray, by solving origin + t direction = a + u e1 + v e2 for every triangle.
std::vector<double> hits_by_sum(const TriangleMesh& mesh, const Vec3d& origin, const Vec3d& direction) {
  std::vector<double> hits;
  for (const Triangle& t : mesh.triangles) {
    Mat3d columns;
    columns << mesh.points[t[1]] - mesh.points[t[0]], mesh.points[t[2]] - mesh.points[t[0]], -direction;
    const Vec3d uvt = columns.inverse() * (origin - mesh.points[t[0]]);
    if (uvt[0] >= 0 && uvt[1] >= 0 && uvt[0] + uvt[1] <= 1 && uvt[2] > 0) hits.push_back(uvt[2]);
  }
  std::sort(hits.begin(), hits.end());
  return hits;
}

Vec3d random_point(std::mt19937& random, double reach) {
  std::uniform_real_distribution<double> uniform(-reach, reach);
  const double x = uniform(random), y = uniform(random), z = uniform(random);
  return {x, y, z};
}

}  // namespace

TEST_CASE("Winding numbers by the tree equal the sum over all triangles, closed and open", "[law]") {
  TriangleMesh bowl = shapes::sphere(1.0, 40);
  std::erase_if(bowl.triangles, [&](const Triangle& t) { return bowl.points[t[0]].z() > 0.3; });
  std::mt19937 random(7);
  for (const TriangleMesh& mesh : {shapes::torus(0.8, 0.3, 120, 40), bowl}) {
    const TriangleTree tree(mesh);
    double worst = 0.0;
    for (int n = 0; n < 300; ++n) {
      const Vec3d X = random_point(random, 1.6);
      worst = std::max(worst, std::abs(tree.winding_number(X) - winding_by_sum(mesh, X)));
    }
    CHECK(worst < 0.01);
  }
}

TEST_CASE("Winding number is 1 inside, 0 outside, -1 inside out, 1/2 in the plane of a flat opening", "[law]") {
  const TriangleMesh sphere = shapes::sphere(1.0, 30);
  CHECK(TriangleTree(sphere).winding_number({0.3, 0.2, -0.5}) == Approx(1.0).margin(0.01));
  CHECK(TriangleTree(sphere).winding_number({0.9, 0.9, 0.9}) == Approx(0.0).margin(0.01));
  CHECK(TriangleTree(shapes::inside_out(sphere)).winding_number({0.3, 0.2, -0.5}) == Approx(-1.0).margin(0.01));
  const TriangleTree open_box(shapes::box({0, 0, 0}, {1, 1, 1}, true));
  CHECK(open_box.winding_number({0.4, 0.7, 1.0}) == Approx(0.5).margin(1e-6));
  CHECK(open_box.winding_number({0.4, 0.7, 0.9}) > 0.5);
  CHECK(open_box.winding_number({0.4, 0.7, 1.1}) < 0.5);
}

TEST_CASE("Rays meet the triangles that a loop over all of them finds", "[law]") {
  const TriangleMesh mesh = shapes::torus(0.8, 0.3, 60, 24);
  const TriangleTree tree(mesh);
  std::mt19937 random(11);
  std::vector<TriangleTree::Hit> hits;
  std::size_t total = 0;
  for (int n = 0; n < 200; ++n) {
    const Vec3d origin = random_point(random, 1.5), direction = random_point(random, 1.0).normalized();
    tree.cast(origin, direction, hits);
    const std::vector<double> expected = hits_by_sum(mesh, origin, direction);
    REQUIRE(hits.size() == expected.size());
    for (std::size_t i = 0; i < hits.size(); ++i) CHECK(hits[i].distance == Approx(expected[i]));
    total += hits.size();
    // Seen from outside the ray enters and leaves in turn.
    if (hits.size() % 2 == 0)
      for (std::size_t i = 0; i < hits.size(); ++i) CHECK((hits[i].cosine > 0) == (i % 2 == 1));
  }
  CHECK(total > 50);
  // Along an axis, where the inverse of the direction is infinite.
  tree.cast({0.8, 0.01, -5}, {0, 0, 1}, hits);
  CHECK(hits.size() == 2);
}
