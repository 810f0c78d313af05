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

TEST_CASE("A ball, a sheet of more than three cells, its edges and corners are not thin; a thinner sheet is") {
  const TestSolid ball = make_ball(cube_grid(20, kH), {}, Vec3d::Constant(0.1), 5.0 * kH);
  const solid::ThinParts none(Parallel(1), ball.rest.distance, kH);
  CHECK(none.bytes() == 0);
  CHECK_FALSE(none.contains(Vec3d(0.15, 0.1, 0.1)));
  const solid::ThinParts thick(Parallel(2), box_distance({10 * kH, 10 * kH, 1.7 * kH}), kH);
  CHECK(thick.bytes() == 0);

  const solid::ThinParts thin(Parallel(2), box_distance({10 * kH, 10 * kH, 1.3 * kH}), kH);
  for (double z = -3.0; z <= 3.0; z += 0.5) CHECK(thin.contains({0, 0, z * kH}));
  CHECK(thin.contains({9.9 * kH, 9.9 * kH, 1.2 * kH}));
  CHECK_FALSE(thin.contains({0, 0, 0.5}));  // far from it
  CHECK_FALSE(thin.contains(Vec3d::Constant(std::numeric_limits<double>::quiet_NaN())));
}

TEST_CASE("A part of two cells on a thick body is thin up to its root") {
  const Vec3d body(5 * kH, 5 * kH, 5 * kH), part(9 * kH, 4 * kH, 1 * kH);  // half their edges; both about the origin
  const Vec3d margin = part.cwiseMax(body) + Vec3d::Constant(4.0 * kH);
  const geometry::SignedDistance distance = sample_distance(-margin, margin, 0.5 * kH, [&](const Vec3d& x) {
    const auto box = [&](const Vec3d& half) {
      const Vec3d beyond = x.cwiseAbs() - half;
      return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
    };
    return std::min(box(body), box(part));
  });
  const solid::ThinParts thin(Parallel(1), distance, kH);
  for (const double x : {5.5, 6.0, 7.0, 8.9}) CHECK(thin.contains({x * kH, 0, 0}));
  CHECK_FALSE(thin.contains({4.0 * kH, 0, 0}));
  CHECK_FALSE(thin.contains({0, 4.9 * kH, 4.9 * kH}));  // an edge of the body
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

TEST_CASE("Slivers of thin parts are elements; the solid's own cells are those that it has without them", "[law]") {
  TestSolid s = make_solid(cube_grid(24, kH), {}, box_distance({8 * kH, 6 * kH, 0.9 * kH}));
  s.rest.element = solid::kElementPartInFluid;
  s.rest.stiff_by_part = true;
  const Mat3d turn = Eigen::AngleAxisd(0.4, Vec3d(1, 2, 0.5).normalized()).toRotationMatrix();
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - turn.transpose() * (x - Vec3d::Constant(12 * kH)); });
  const bool remembers = GENERATE(false, true);
  std::vector<bool> own;
  std::size_t slivers = 0;
  for (const bool knows : {false, true}) {
    if (knows) s.rest.thin = solid::ThinParts(Parallel(2), s.rest.distance, kH);
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    if (remembers) {
      solid::remember_elements(s.work, true, s.state);  // slivers are not remembered
      solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    }
    std::vector<bool> now;
    for (std::size_t c = 0; c < s.work.element.size(); ++c) {
      now.push_back(s.work.owns(c));
      if (s.work.element[c] < 0 || s.work.owns(c)) continue;
      ++slivers;
      CHECK(s.work.fraction[c] > solid::kSliverPart);
    }
    if (knows) CHECK(now == own);
    own = now;
    s.state.stiff.clear();
  }
  CHECK(slivers > 50);
}

TEST_CASE("Where slivers are asked for, what is as full as an element in vacuum and no cell of the solid is one",
          "[law]") {
  TestSolid s = make_ball(cube_grid(18, 0.02), {}, Vec3d(0.183, 0.176, 0.181), 0.1);
  s.rest.element = solid::kElementPartInFluid;
  s.rest.stiff_by_part = true;
  solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
  const double mass = s.work.total_mass;
  std::vector<bool> own;
  for (std::size_t c = 0; c < s.work.element.size(); ++c) own.push_back(s.work.owns(c));
  CHECK(s.work.element_cell.size() == s.work.owned_cells());
  s.rest.sliver = solid::kElementPart.fraction;
  solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
  std::size_t slivers = 0;
  for (std::size_t c = 0; c < s.work.element.size(); ++c) {
    CHECK(s.work.owns(c) == own[c]);
    CHECK((s.work.element[c] >= 0) == (s.work.fraction[c] > solid::kElementPart.fraction));
    if (s.work.element[c] < 0 || s.work.owns(c)) continue;
    ++slivers;
    CHECK(solid::bulk_weight(s.rest, s.work, static_cast<std::size_t>(s.work.element[c])) == 0.0);
  }
  CHECK(slivers > 30);
  CHECK(s.work.total_mass == Approx(mass).epsilon(1e-6));
  CHECK(s.work.element_weight == Approx(1.0).epsilon(0.01));
}

TEST_CASE("The outer corners of a sliver keep nearly half of its mass", "[law]") {
  const double f = GENERATE(0.06, 0.2, 0.55);
  const double half = 0.5 * (1.0 + f) * kH;  // of a sheet that fills one layer of cells, and f of the next
  TestSolid s = make_solid(cube_grid(24, kH), {}, box_distance({8 * kH, 8 * kH, half}));
  s.rest.element = solid::kElementPartInFluid;
  s.rest.stiff_by_part = true;
  s.rest.thin = solid::ThinParts(Parallel(1), s.rest.distance, kH);
  const Vec3d center(12 * kH, 12 * kH, 12 * kH + half);
  set_displacement(s, [&](const Vec3d&) -> Vec3d { return center; });
  solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  REQUIRE(s.work.carries[g.node(12, 12, 14)]);
  const double cell = s.rest.density * kH * kH * kH;
  // In the middle of the solid part it would be f^2 / 2, as it is in cells that are elements elsewhere, too.
  const double middle = (1.0 - f) * std::min(1.0, f / 0.5);
  CHECK(static_cast<double>(s.work.mass[g.node(12, 12, 14)]) == Approx(0.5 * cell * f * (1.0 - middle)).epsilon(0.03));
  CHECK(static_cast<double>(s.work.mass[g.node(12, 12, 12)]) == Approx(0.5 * cell).epsilon(0.03));
}

TEST_CASE("What is strained by more than half, or inverted, is no sliver", "[law]") {
  TestSolid s = make_solid(cube_grid(24, kH), {}, box_distance({8 * kH, 6 * kH, 0.9 * kH}));
  s.rest.element = solid::kElementPartInFluid;
  s.rest.stiff_by_part = true;
  s.rest.thin = solid::ThinParts(Parallel(1), s.rest.distance, kH);
  const Vec3d center(12.2 * kH, 12.1 * kH, 12.3 * kH);
  // Number of slivers of the sheet, its length times `stretch` and its width over it.
  const auto slivers = [&](double stretch) {
    set_displacement(s, [&](const Vec3d& x) -> Vec3d {
      const Vec3d y = x - center;
      return x - Vec3d(y[0] / stretch, y[1] * std::abs(stretch), y[2]);
    });
    s.state.stiff.clear();
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    return s.work.element_cell.size() - s.work.owned_cells();
  };
  CHECK(slivers(1.0) > 50);
  CHECK(slivers(1.45) > 50);
  CHECK(slivers(1.55) == 0);
  CHECK(slivers(1.0 / 1.55) == 0);
  CHECK(slivers(-1.0) == 0);
}
