// Purpose: coincident points, open and non-manifold edges, holes, parts and orientation.
#include <catch2/catch.hpp>

#include "geometry/mesh_topology.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

// One closed, consistently oriented, manifold surface.
bool is_simple(const Topology& t) {
  return t.closed() && t.nonmanifold_edges == 0 && t.inconsistent_edges == 0 && t.parts == 1;
}

// The mesh with three points of its own for every triangle.
TriangleMesh split(const TriangleMesh& mesh) {
  TriangleMesh result;
  for (const Triangle& t : mesh.triangles) {
    const auto first = static_cast<std::int32_t>(result.points.size());
    for (const std::int32_t corner : t) result.points.push_back(mesh.points[corner]);
    result.triangles.push_back({first, first + 1, first + 2});
  }
  return result;
}

}  // namespace

TEST_CASE("Split points are joined for the topology only") {
  const TriangleMesh whole = shapes::sphere(1.0, 6), pieces = split(whole);
  CHECK(analyse_topology(pieces).open_edges == 3 * whole.triangles.size());
  const TriangleMesh welded = weld(pieces);
  CHECK(welded.points.size() == pieces.points.size());
  CHECK(is_simple(analyse_topology(welded)));
  CHECK(inspect(pieces).closed);
  // Points closer than the tolerance are the same, points a thousandth apart are not.
  const double tiny = 1e-9, small = 1e-3;
  const TriangleMesh pair = triangulate({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1 + tiny, 0, 0}, {0, 1, tiny}, {1, 1, 0}},
                                        {}, std::vector<std::int32_t>{0, 1, 2, 3, 5, 4});
  CHECK(weld_points(pair) == std::vector<std::int32_t>{0, 1, 2, 1, 2, 5});
  const TriangleMesh apart = triangulate({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1 + small, 0, 0}, {0, 1, small}, {1, 1, 0}},
                                         {}, std::vector<std::int32_t>{0, 1, 2, 3, 5, 4});
  CHECK(weld_points(apart) == std::vector<std::int32_t>{0, 1, 2, 3, 4, 5});
}

TEST_CASE("Open edges form holes with a length") {
  const MeshReport box = inspect(shapes::box({0, 0, 0}, {1, 2, 3}, true));
  CHECK_FALSE(box.closed);
  CHECK(box.open_edges == 4);
  CHECK(box.holes == 1);
  CHECK(box.largest_hole == Approx(6.0));
  CHECK(box.triangles == 10);
  CHECK(box.extent_max == Vec3d(1, 2, 3));

  // A sphere without the eight triangles at its poles: six square holes.
  TriangleMesh sphere = shapes::sphere(1.0, 5);
  std::erase_if(sphere.triangles, [&](const Triangle& t) {
    return std::any_of(t.begin(), t.end(),
                       [&](int corner) { return sphere.points[corner].cwiseAbs().maxCoeff() > 0.999; });
  });
  CHECK(inspect(sphere).holes == 6);

  // Two holes that touch in one point: two loops, not one.
  const TriangleMesh sheet = triangulate({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}, {},
                                         std::vector<std::int32_t>{0, 1, 2, 0, 3, 4});
  CHECK(inspect(sheet).holes == 2);
  CHECK(inspect(sheet).open_edges == 6);
}

TEST_CASE("Non-manifold edges, parts and inconsistent sides are counted") {
  // Two boxes that share an edge: four triangles there.
  const TriangleMesh boxes =
      weld(shapes::together(shapes::box({0, 0, 0}, {1, 1, 1}), shapes::box({1, 1, 0}, {2, 2, 1})));
  const Topology topology = analyse_topology(boxes);
  CHECK(topology.nonmanifold_edges == 1);
  CHECK(topology.open_edges == 0);
  CHECK(topology.unbalanced_edges == 0);
  CHECK(topology.parts == 1);
  CHECK_FALSE(is_simple(topology));

  TriangleMesh turned = shapes::box({0, 0, 0}, {1, 1, 1});
  std::swap(turned.triangles[3][0], turned.triangles[3][1]);
  CHECK(analyse_topology(turned).inconsistent_edges == 3);
  CHECK_FALSE(is_simple(analyse_topology(turned)));
  CHECK(analyse_topology(shapes::together(turned, shapes::sphere(9, 2))).parts == 2);
}

TEST_CASE("Triangles are turned to agree with each other and to point out of the solid", "[law]") {
  TriangleMesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  SECTION("a right mesh is left alone") {
    const TriangleMesh before = box;
    const OrientationRepair repair = orient_outwards(box);
    CHECK(box.triangles == before.triangles);
    CHECK((repair.reversed_triangles == 0 && repair.turned_parts == 0 && !repair.turned_mesh));
  }
  SECTION("some triangles against their neighbours") {
    for (const int t : {1, 4, 9}) std::swap(box.triangles[t][0], box.triangles[t][2]);
    CHECK(orient_outwards(box).reversed_triangles == 3);
    CHECK(signed_volume(box) == Approx(1.0));
  }
  SECTION("the whole mesh") {
    box = shapes::inside_out(box);
    CHECK(orient_outwards(box).turned_mesh);
    CHECK(signed_volume(box) == Approx(1.0));
  }
  SECTION("a part beside another is turned, the wall of a cavity is not") {
    TriangleMesh parts =
        shapes::together(shapes::box({0, 0, 0}, {4, 4, 4}), shapes::inside_out(shapes::sphere(1, 8, {2, 2, 2})));
    const double hollow = signed_volume(parts);
    CHECK(orient_outwards(parts).turned_parts == 0);
    CHECK(signed_volume(parts) == Approx(hollow));
    parts = shapes::together(parts, shapes::inside_out(shapes::box({6, 0, 0}, {7, 1, 1})));
    CHECK(orient_outwards(parts).turned_parts == 1);
    CHECK(signed_volume(parts) == Approx(hollow + 1.0));
  }
}

TEST_CASE("Closing triangles balance every edge of any mesh", "[law]") {
  TriangleMesh ribbon = shapes::torus(1.0, 0.3, 24, 12);  // every third triangle is missing, and some stand in threes
  std::size_t number = 0;
  std::erase_if(ribbon.triangles, [&](const Triangle&) { return number++ % 3 == 0; });
  TriangleMesh thrice = shapes::box({0, 0, 0}, {1, 1, 1}, true);
  const std::vector<Triangle> once = thrice.triangles;
  for (int copy = 0; copy < 2; ++copy) thrice.triangles.insert(thrice.triangles.end(), once.begin(), once.end());
  for (TriangleMesh mesh : {ribbon, thrice, shapes::box({0, 0, 0}, {1, 1, 1}, true)}) {
    CHECK(analyse_topology(mesh).unbalanced_edges > 0);
    const std::vector<Triangle> closing = closing_triangles(mesh);
    mesh.triangles.insert(mesh.triangles.end(), closing.begin(), closing.end());
    CHECK(analyse_topology(mesh).unbalanced_edges == 0);
  }
  CHECK(closing_triangles(shapes::sphere(1.0, 5)).empty());
  CHECK(closing_triangles(shapes::box({0, 0, 0}, {1, 1, 1}, true)).size() == 2);
}
