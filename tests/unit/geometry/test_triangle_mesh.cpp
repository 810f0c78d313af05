// Purpose: polygons become triangles of the same outline; bad meshes are refused by name; volume, extents, normals.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <limits>

#include "base/error.hpp"
#include "geometry/triangle_mesh.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

Vec3d vector_area(const TriangleMesh& mesh) {
  Vec3d sum = Vec3d::Zero();
  for (const Triangle& t : mesh.triangles)
    sum += 0.5 * (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]);
  return sum;
}

TriangleMesh one_polygon(const std::vector<Vec3d>& points) {
  std::vector<std::int32_t> indices;
  for (std::size_t i = 0; i < points.size(); ++i) indices.push_back(static_cast<std::int32_t>(i));
  return triangulate(points, std::vector<std::int32_t>{static_cast<std::int32_t>(points.size())}, indices);
}

std::string refusal(std::vector<Vec3d> points, std::vector<std::int32_t> counts, std::vector<std::int32_t> indices) {
  try {
    triangulate(std::move(points), counts, indices);
  } catch (const Error& error) {
    CHECK(error.code() == ErrorCode::kMesh);
    return error.what();
  }
  return "accepted";
}

const std::vector<Vec3d> kSquare = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};

}  // namespace

TEST_CASE("A polygon is covered once by its triangles, concave or not, in any plane", "[law]") {
  const std::vector<std::vector<Vec3d>> polygons = {
      kSquare,
      {{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}},                        // arrow head, notch at corner 2
      {{1, 1, 0}, {0, 4, 0}, {0, 0, 0}, {4, 0, 0}},                        // the same, notch at corner 0
      {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}},  // L
      {{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}},  // U
      // square with a square hole, joined by a bridge
      {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {0, 0, 0}, {1, 1, 0}, {1, 3, 0}, {3, 3, 0}, {3, 1, 0}, {1, 1, 0}},
  };
  const std::vector<double> areas = {1, 4, 4, 3, 7, 12};
  const Eigen::AngleAxisd turn(1.1, Vec3d(1, -2, 0.5).normalized());
  for (std::size_t i = 0; i < polygons.size(); ++i) {
    for (const bool turned : {false, true}) {
      std::vector<Vec3d> points = polygons[i];
      if (turned)
        for (Vec3d& p : points) p = turn * p + Vec3d(3, -1, 2);
      const TriangleMesh mesh = one_polygon(points);
      INFO("polygon " << i);
      CHECK(mesh.triangles.size() == points.size() - 2);
      CHECK(surface_area(mesh) == Approx(areas[i]));
      CHECK(vector_area(mesh).norm() == Approx(areas[i]));
      CHECK(vector_area(mesh).dot(turned ? turn * Vec3d::UnitZ() : Vec3d::UnitZ()) == Approx(areas[i]));
    }
  }
}

TEST_CASE("A polygon without an ear keeps its outline") {
  // A bow tie and a polygon of zero area: the triangles' vector area is that of the outline.
  for (const auto& points : {std::vector<Vec3d>{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1.5, 0}},
                             std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}}}) {
    Vec3d outline = Vec3d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) outline += 0.5 * points[i].cross(points[(i + 1) % points.size()]);
    const TriangleMesh mesh = one_polygon(points);
    CHECK(mesh.triangles.size() == points.size() - 2);
    CHECK((vector_area(mesh) - outline).norm() < 1e-12);
  }
}

TEST_CASE("Without counts every face is a triangle, and points keep number and order") {
  std::vector<Vec3d> points = kSquare;
  points.push_back({9, 9, 9});  // used by no face
  const TriangleMesh mesh = triangulate(points, {}, std::vector<std::int32_t>{0, 1, 2, 0, 2, 3});
  CHECK(mesh.points == points);
  CHECK(mesh.triangles == std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}});
  CHECK(extents(mesh).max == Vec3d(1, 1, 0));
}

TEST_CASE("A bad mesh is refused with entry, value and limit") {
  using Catch::Matchers::Contains;
  CHECK_THAT(refusal(kSquare, {4}, {0, 1, 2, 4}), Contains("face_vertex_indices[3] = 4: must be in [0, 4)"));
  CHECK_THAT(refusal(kSquare, {4}, {0, -1, 2, 3}), Contains("face_vertex_indices[1] = -1: must be in [0, 4)"));
  CHECK_THAT(refusal(kSquare, {2, 3}, {0, 1, 2, 3, 0}), Contains("face_vertex_counts[0] = 2: must be at least 3"));
  CHECK_THAT(refusal(kSquare, {3, -7}, {0, 1, 2}), Contains("face_vertex_counts[1] = -7: must be at least 3"));
  CHECK_THAT(refusal(kSquare, {4, 4}, {0, 1, 2, 3}), Contains("add up to 8, but face_vertex_indices has 4"));
  CHECK_THAT(refusal(kSquare, {}, {0, 1, 2, 3}), Contains("4 entries: triangles need a multiple of 3"));
  CHECK_THAT(refusal(kSquare, {}, {}), Contains("no face"));
  std::vector<Vec3d> points = kSquare;
  points[2].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(refusal(points, {4}, {0, 1, 2, 3}), Contains("points[2] = (1.000000, nan, 0.000000): must be finite"));
  points[2].y() = std::numeric_limits<double>::infinity();
  CHECK_THAT(refusal(points, {4}, {0, 1, 2, 3}), Contains("points[2] = (1.000000, inf, 0.000000): must be finite"));
}

TEST_CASE("Signed volume: box, sphere, torus; negative inside out; the same wherever the mesh is", "[law]") {
  const TriangleMesh box = shapes::box({1, 2, 3}, {2, 4, 6});
  CHECK(signed_volume(box) == Approx(6.0));
  CHECK(surface_area(box) == Approx(22.0));
  CHECK(surface_area(shapes::sphere(0.5, 40)) == Approx(std::numbers::pi).epsilon(2e-3));
  CHECK(signed_volume(shapes::inside_out(box)) == Approx(-6.0));
  CHECK(signed_volume(shapes::sphere(0.5, 40)) == Approx(std::numbers::pi / 6).epsilon(2e-3));
  CHECK(signed_volume(shapes::torus(1.0, 0.25, 200, 60)) ==
        Approx(2 * std::numbers::pi * std::numbers::pi / 16).epsilon(3e-3));
  CHECK(signed_volume(shapes::box({0, 0, 0}, {1, 1, 1}, true)) ==
        Approx(signed_volume(shapes::box({1000, -1000, 0}, {1001, -999, 1}, true))));
  // An open mesh: turned and stretched by F its volume is that times det F.
  TriangleMesh open = shapes::box({0, 0, 0}, {1, 2, 3}, true);
  const double before = signed_volume(open);
  CHECK(before > 3.0);
  Mat3d f;
  f << 0.3, -1.2, 0.1, 0.9, 0.2, -0.4, 0.2, 0.5, 1.1;
  for (Vec3d& x : open.points) x = f * x + Vec3d(5, 6, 7);
  CHECK(signed_volume(open) == Approx(f.determinant() * before));
  CHECK(signed_volume({}, {}) == 0.0);
}

TEST_CASE("Centre of volume: pyramid, inside out, open, flat; it moves with the mesh", "[law]") {
  const TriangleMesh pyramid = triangulate({{0, 0, 0}, {4, 0, 0}, {0, 8, 0}, {0, 0, 12}}, {},
                                           std::vector<std::int32_t>{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3});
  CHECK((center_of_volume(pyramid) - Vec3d(1, 2, 3)).norm() < 1e-12);
  CHECK((center_of_volume(shapes::inside_out(pyramid)) - Vec3d(1, 2, 3)).norm() < 1e-12);
  TriangleMesh open = shapes::box({0, 0, 0}, {1, 2, 3}, true);
  const Vec3d before = center_of_volume(open), travelled(1e4, -2e4, 3e4);
  CHECK((before - Vec3d(0.5, 1, 1.5)).norm() < 0.3);
  for (Vec3d& x : open.points) x += travelled;
  CHECK((center_of_volume(open) - before - travelled).norm() < 1e-9);
  const TriangleMesh flat = one_polygon({{1, 1, 5}, {3, 1, 5}, {3, 3, 5}, {1, 3, 5}});
  CHECK((center_of_volume(flat) - Vec3d(2, 2, 5)).norm() < 1e-12);
}

TEST_CASE("Vertex normals point outwards and are weighted by area") {
  const TriangleMesh sphere = shapes::sphere(2.0, 20);
  const std::vector<Vec3d> normals = vertex_normals(sphere);
  double worst = 1.0;
  for (std::size_t i = 0; i < normals.size(); ++i) worst = std::min(worst, normals[i].dot(sphere.points[i]) / 2.0);
  CHECK(worst > 0.995);
  // Two faces at a right angle, one three times as large as the other.
  const TriangleMesh roof = triangulate({{0, 0, 0}, {1, 0, 0}, {0, 3, 0}, {0, 0, 1}, {5, 5, 5}}, {},
                                        std::vector<std::int32_t>{0, 1, 2, 0, 3, 1});
  const std::vector<Vec3d> corners = vertex_normals(roof);
  CHECK((corners[0] - Vec3d(0, 1, 3).normalized()).norm() < 1e-12);
  CHECK(corners[4] == Vec3d::Zero());
}
