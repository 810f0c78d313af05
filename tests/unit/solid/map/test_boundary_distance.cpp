// Purpose: the distance to the boundary of a solid that is crushed by more than its gradient is believed.
#include <catch2/catch.hpp>

#include "solid/map/boundary_distance.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kH = 0.05, kFace = 0.7, kGrowth = 1.0;  // [m]; of the gradient, per cell of depth

// A half-space X < kFace. What is d cells deep now was d + kGrowth d^2 / 2 cells deep: crushed to 1 / (1 + kGrowth d).
TestSolid make_crushed() {
  TestSolid s = make_solid(
      cube_grid(20, kH), {},
      sample_distance(Vec3d::Constant(-2.0), Vec3d::Constant(2.0), kH, [](const Vec3d& x) { return x[0] - kFace; }));
  set_displacement(s, [](const Vec3d& x) {
    const double d = (kFace - x[0]) / kH;
    return Vec3d(d > 0.0 ? kH * 0.5 * kGrowth * d * d : 0.0, 0.0, 0.0);
  });
  return s;
}

double distance_at(const TestSolid& s, double depth, double length) {
  return solid::boundary_distance(s.rest, s.state, Vec3d(kFace - depth * kH, 0.5, 0.5), Vec3d(1, 0, 0), length) / kH;
}

}  // namespace

TEST_CASE("Where the bounded gradient leads beyond the boundary the boundary is found", "[law]") {
  const TestSolid s = make_crushed();
  for (const double depth : {2.0, 3.0, 4.0}) {
    const double at_rest = depth + 0.5 * kGrowth * depth * depth;
    CHECK(at_rest / 1.5 > 1.3 * depth);  // what the estimate says
    CHECK(distance_at(s, depth, 1.5) == Approx(-depth).margin(0.15));
  }
}

TEST_CASE("Outside, and where the estimate ends before the boundary, it is the distance") {
  const TestSolid s = make_crushed();
  CHECK(distance_at(s, -2.0, 1.0) == Approx(2.0).margin(1e-6));
  CHECK(distance_at(s, 4.0, 5.0) == Approx(-12.0 / 5.0).margin(0.01));
}

TEST_CASE("Where the map at the end of the estimate is not known the estimate is the distance") {
  TestSolid s = make_crushed();
  const grid::Grid& g = s.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        if (g.node_position(i, j, k)[0] > kFace + 0.5 * kH) s.state.valid[g.node(i, j, k)] = solid::kNoData;
  CHECK(distance_at(s, 4.0, 1.5) == Approx(-12.0 / 1.5).margin(0.01));
}

TEST_CASE("The boundary is seen where a uniform stretch has it, as far as that is believed", "[law]") {
  const Vec3d normal = Vec3d(1.0, 2.0, -2.0) / 3.0;
  for (const double stretch : {0.5, 1.0, 2.0, 8.0}) {
    const auto seen = solid::see_boundary(0.3, normal / stretch, solid::kCutStretch);  // F = stretch I
    CHECK(seen.distance == Approx(0.3 * std::min(stretch, 1.0 / solid::kCutStretch.least)));
    CHECK((seen.outwards - normal).norm() < 1e-12);
  }
  CHECK(solid::see_boundary(0.3, Vec3d::Zero(), solid::kCutStretch).outwards.isZero());
}
