// Purpose: which parts of a solid are thin at rest, and that what is thin holds together on the grid.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <set>
#include <vector>

#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kH = 0.01;

// Of a box about the origin, exact: h of the grid is kH.
geometry::SignedDistance box_distance(const Vec3d& half) {
  const Vec3d margin = half + Vec3d::Constant(4.0 * kH);
  return sample_distance(-margin, margin, 0.5 * kH, [&](const Vec3d& x) {
    const Vec3d beyond = x.cwiseAbs() - half;
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
  });
}

// Number of parts that elements form which share a face.
std::size_t count_parts(const TestSolid& s) {
  const grid::Grid& g = s.state.band.grid;
  std::set<std::int32_t> left(s.work.element_cell.begin(), s.work.element_cell.end());
  const std::int32_t stride[3] = {1, g.cells[0], g.cells[0] * g.cells[1]};
  std::size_t parts = 0;
  while (!left.empty()) {
    ++parts;
    std::vector<std::int32_t> stack{*left.begin()};
    left.erase(left.begin());
    while (!stack.empty()) {
      const std::int32_t cell = stack.back();
      stack.pop_back();
      for (const std::int32_t step : stride)
        for (const std::int32_t next : {cell - step, cell + step})
          if (left.erase(next) > 0) stack.push_back(next);
    }
  }
  return parts;
}

}  // namespace

TEST_CASE("A ball and the middle of a thick sheet are not thin; a sheet under three cells, edges and tips are") {
  const TestSolid ball = make_ball(cube_grid(20, kH), {}, Vec3d::Constant(0.1), 5.0 * kH);
  const solid::ThinParts none(Parallel(1), ball.rest.distance, kH);
  CHECK(none.bytes() == 0);
  CHECK_FALSE(none.contains(Vec3d(0.15, 0.1, 0.1)));

  const solid::ThinParts thick(Parallel(2), box_distance({10 * kH, 10 * kH, 1.7 * kH}), kH);
  const solid::ThinParts thin(Parallel(2), box_distance({10 * kH, 10 * kH, 1.3 * kH}), kH);
  for (double z = -3.0; z <= 3.0; z += 0.5) {
    CHECK_FALSE(thick.contains({0, 0, z * kH}));
    CHECK(thin.contains({0, 0, z * kH}));
    CHECK_FALSE(thick.contains({7 * kH, -7 * kH, z * kH}));
  }
  CHECK(thick.contains({9.9 * kH, 0, 1.6 * kH}));  // an edge
  CHECK(thick.contains({9.9 * kH, 9.9 * kH, 1.6 * kH}));
  CHECK_FALSE(thin.contains({0, 0, 0.5}));  // far from it
  CHECK_FALSE(thin.contains(Vec3d::Constant(std::numeric_limits<double>::quiet_NaN())));
}

TEST_CASE("A sheet of 0.6 to 2.4 cells is one part of elements, wherever it lies between nodes", "[law]") {
  const double half = GENERATE(0.3, 0.6, 1.2) * kH;
  TestSolid s = make_solid(cube_grid(24, kH), {}, box_distance({8 * kH, 6 * kH, half}));
  s.rest.element = GENERATE(solid::kElementPart, solid::kElementPartInFluid);
  s.rest.stiff_by_part = true;
  std::size_t torn = 0;
  for (const bool knows : {false, true}) {
    if (knows) s.rest.thin = solid::ThinParts(Parallel(1), s.rest.distance, kH);
    for (int n = 0; n < 24; ++n) {
      const Mat3d turn =
          (Eigen::AngleAxisd(0.7 * n, Vec3d::UnitZ()) * Eigen::AngleAxisd(0.23 * n, Vec3d::UnitX())).toRotationMatrix();
      const Vec3d center = kH * Vec3d(12 + 0.31 * n, 12 - 0.17 * n, 12 + n / 24.0);
      set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - turn.transpose() * (x - center); });
      s.state.stiff.clear();
      solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
      if (knows) CHECK(count_parts(s) == 1);
      torn += !knows && count_parts(s) != 1;
    }
  }
  INFO("half thickness " << half / kH << " cells: torn without: " << torn);
  if (half < 0.5 * kH) CHECK(torn > 4);
}
