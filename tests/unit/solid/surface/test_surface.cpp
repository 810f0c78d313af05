// Purpose: the embedded surface: edges that the solid's deformation does not explain.
#include <array>
#include <catch2/catch.hpp>

#include "solid/surface/surface.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// An octahedron of radius 0.1: 8 triangles, 12 edges of 0.1414, each in two triangles.
TestSolid make_octahedron() {
  const Vec3d center(0.18, 0.18, 0.18);
  TestSolid s = make_ball(cube_grid(18, 0.02), {}, center, 0.1);
  for (const Vec3d& axis : std::array<Vec3d, 3>{Vec3d::UnitX(), Vec3d::UnitY(), Vec3d::UnitZ()})
    for (const double sign : {1.0, -1.0}) s.rest.surface.points.push_back(center + sign * 0.1 * axis);
  for (const std::int32_t x : {0, 1})
    for (const std::int32_t y : {2, 3})
      for (const std::int32_t z : {4, 5}) s.rest.surface.triangles.push_back({x, y, z});
  s.state.surface = s.rest.surface.points;
  return s;
}

}  // namespace

TEST_CASE("No edge is false where the surface is stretched as the solid is, whatever the motion", "[law]") {
  TestSolid s = make_octahedron();
  const Vec3d stretch(3.0, 1.0, 0.4);
  for (Vec3d& x : s.state.surface) x = Vec3d(5.0, -2.0, 1.0) + stretch.asDiagonal() * x;
  CHECK(solid::count_false_edges(s.rest, s.state, 3.0) == 0);
  CHECK(solid::count_false_edges(s.rest, s.state, 1.0) == 0);  // 3 < 4
}

TEST_CASE("A vertex that travels with another part has its edges counted, each once") {
  TestSolid s = make_octahedron();
  s.state.surface[0] += Vec3d(0.7, 0.0, 0.0);  // its four edges are 0.806 long, 5.7 times their length
  CHECK(solid::count_false_edges(s.rest, s.state, 1.0) == 4);
  CHECK(solid::count_false_edges(s.rest, s.state, 1.4) == 4);
  CHECK(solid::count_false_edges(s.rest, s.state, 1.5) == 0);  // 6 times are explained
}

TEST_CASE("Points that coincide have no false edge through rounding, and one as soon as they part") {
  TestSolid s = make_octahedron();
  s.rest.surface.points.push_back(s.rest.surface.points[0]);
  s.rest.surface.triangles.push_back({0, 6, 2});
  s.state.surface = s.rest.surface.points;
  s.state.surface[6] += Vec3d(1e-6, 0.0, 0.0);
  CHECK(solid::count_false_edges(s.rest, s.state, 1.0) == 0);
  s.state.surface[6] += Vec3d(1e-3, 0.0, 0.0);
  CHECK(solid::count_false_edges(s.rest, s.state, 1.0) == 1);
}

TEST_CASE("The largest stretch is that of the deformation", "[law]") {
  TestSolid s = make_block(cube_grid(6, 0.1), material::from_youngs_modulus(material::Law::kCorotational, 1e4, 0.3));
  // x = diag(2, 0.8, 1) X: u = x - X = (x/2, -x/4, 0).
  set_displacement(s, [](const Vec3d& x) { return Vec3d(0.5 * x[0], -0.25 * x[1], 0.0); });
  compute(s, 1);
  CHECK(s.work.max_stretch == Approx(2.0).epsilon(1e-5));
}
