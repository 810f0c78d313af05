// Purpose: volume fractions and mass of a solid on the grid.
#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "solid/element/material_lattice.hpp"
#include "solid/element/plasticity.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kPi = 3.14159265358979323846;

}  // namespace

TEST_CASE("The mass of a ball is that of a ball and does not change when it moves by parts of a cell", "[law]") {
  // Ten cells per radius; the planes that cut the cells miss the curvature, an error of second order in the cell.
  constexpr double kH = 0.01, kRadius = 0.1;
  TestSolid s = make_ball(cube_grid(26, kH), kSoft, Vec3d::Constant(0.13), kRadius);
  const double exact = 4.0 / 3.0 * kPi * kRadius * kRadius * kRadius * s.rest.density;
  double lowest = 1e300, highest = 0.0;
  for (int shift = 0; shift < 12; ++shift) {
    const Vec3d t = kH * Vec3d(shift / 12.0, 0.37 * shift / 12.0, -0.71 * shift / 12.0);
    set_displacement(s, [&](const Vec3d&) { return t; });
    s.rest.mass_volume = 0.0;  // not known: the mass is counted in cells
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    CHECK(s.work.total_mass == Approx(exact).epsilon(3e-3));
    CHECK(s.work.volume * s.rest.density == Approx(s.work.total_mass).epsilon(2e-3));  // but for slivers
    lowest = std::min(lowest, s.work.total_mass);
    highest = std::max(highest, s.work.total_mass);
    // What the nodes carry once it is known does not change at all.
    s.rest.mass_volume = s.rest.volume;
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    double sum = 0.0;
    for (const Real m : s.work.mass) sum += static_cast<double>(m);
    CHECK(sum == Approx(s.rest.density * s.rest.volume).epsilon(1e-5));
  }
  INFO("between " << lowest / exact << " and " << highest / exact);
  CHECK(highest / lowest - 1.0 < 2e-3);
}

TEST_CASE("A solid that has partly left the box weighs what is left of it") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d::Constant(0.18), 0.1);
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  s.rest.mass_volume = s.work.volume;
  set_displacement(s, [&](const Vec3d&) { return Vec3d(-0.18, 0, 0); });  // half of it is outside
  s.state.whole = 0;
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  CHECK(s.work.total_mass == Approx(0.5 * s.rest.density * s.rest.mass_volume).epsilon(0.02));
}

TEST_CASE("A stretched solid keeps its mass and gains volume by det F", "[law]") {
  TestSolid s = make_ball(cube_grid(24, 0.02), kSoft, Vec3d::Zero(), 0.1);
  Mat3d f;
  f << 1.3, 0.2, 0.0, 0.1, 0.9, -0.1, 0.0, 0.2, 1.1;
  const Mat3d inverse = f.inverse();
  const Vec3d center = Vec3d::Constant(0.24);
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - inverse * (x - center); });
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const double volume = 4.0 / 3.0 * kPi * 1e-3;
  CHECK(s.work.total_mass == Approx(volume * s.rest.density).epsilon(5e-3));
  CHECK(s.work.volume == Approx(volume * f.determinant()).epsilon(5e-3));
  for (std::size_t e = 0; e < s.work.element_cell.size(); ++e)
    CHECK(static_cast<double>(s.work.volume_ratio[static_cast<std::size_t>(s.work.element_cell[e])]) ==
          Approx(f.determinant()).epsilon(1e-4));
}

TEST_CASE("Mass of cut cells goes to nodes that carry stiffness, and the elements weigh as much as the body") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d(0.183, 0.176, 0.181), 0.1);
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  double carried = 0.0, stray = 0.0;
  for (std::size_t n = 0; n < s.work.mass.size(); ++n)
    (s.work.carries[n] ? carried : stray) += static_cast<double>(s.work.mass[n]);
  CHECK(carried + stray == Approx(s.work.total_mass));
  CHECK(stray == 0.0);
  const double h3 = 0.02 * 0.02 * 0.02;
  const double filled = static_cast<double>(s.work.element_cell.size()) * h3;
  CHECK(filled == Approx(s.work.volume).epsilon(0.1));
  CHECK(s.work.element_weight * filled == Approx(s.work.volume));
  for (const auto c : s.work.element_cell)
    CHECK(s.work.fraction[static_cast<std::size_t>(c)] > solid::kElementPartInFluid.fraction);
}

TEST_CASE("Beside a collider a cell carries stiffness when half of what the solid can fill is solid") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d(0.183, 0.176, 0.181), 0.1);
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  const std::vector<std::int32_t> before = s.work.element;
  const auto [fraction, lag] = solid::kElementPartInFluid;
  const double room = GENERATE(0.4, 0.75, 1.0);
  const bool lags = GENERATE(false, true);
  solid::remember_elements(s.work, lags, s.state);
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) solid::remember_room({i + g.lo[0], j + g.lo[1], k + g.lo[2]}, room, s.state);
  solid::remember_room({g.lo[0] - 1, g.lo[1], g.lo[2]}, room, s.state);  // not in the band
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  std::size_t entered = 0;
  for (std::size_t c = 0; c < before.size(); ++c) {
    const bool was = before[c] >= 0, is = s.work.element[c] >= 0;
    const bool stays = lags && was;  // in a cell whose room has become smaller, too
    const Real plain = fraction + (lags ? lag : 0);
    const Real beside = static_cast<Real>(0.5 * std::max(room, solid::kLeastRoom)) - (stays ? lag : 0);
    CHECK(is == (s.work.fraction[c] > (stays || room > solid::kLeastRoom ? beside : plain)));
    entered += is && !was;
  }
  CHECK((entered > 10) == (room > solid::kLeastRoom));
}

TEST_CASE("Cells take up stiffness later and drop it later than half full") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d(0.183, 0.176, 0.181), 0.1);
  const auto stiff = [&] {
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    std::vector<std::uint8_t> marks;
    for (const std::int32_t e : s.work.element) marks.push_back(e >= 0);
    return marks;
  };
  const auto fresh = stiff();
  solid::remember_elements(s.work, true, s.state);
  CHECK(s.state.stiff == fresh);
  CHECK(stiff() == fresh);  // a solid at rest keeps its elements
  for (const bool before : {false, true}) {
    s.state.stiff.assign(fresh.size(), before);
    const auto now = stiff();
    const Real limit = solid::kElementPartInFluid.fraction +
                       (before ? -solid::kElementPartInFluid.lag : solid::kElementPartInFluid.lag);
    std::size_t changed = 0;
    for (std::size_t c = 0; c < now.size(); ++c) {
      CHECK(now[c] == (s.work.fraction[c] > limit));
      changed += now[c] != fresh[c];
    }
    CHECK(changed > 10);
  }
}

TEST_CASE("Cells without data carry neither mass nor stiffness") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d::Constant(0.18), 0.1);
  std::fill(s.state.valid.begin(), s.state.valid.end(), std::uint8_t{0});
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  CHECK(s.work.total_mass == 0.0);
  CHECK(s.work.element_cell.empty());
}

TEST_CASE("What the extension made up is no solid, and what it had a part in only while it is in shape") {
  // The whole ball a second time: a map that leads back into it.
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d::Constant(0.18), 0.1);
  const auto elements = [&](std::uint8_t origin, const Vec3d& stretch) {
    const Vec3d center = Vec3d::Constant(0.18);
    set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - center - (x - center).cwiseQuotient(stretch); });
    std::fill(s.state.valid.begin(), s.state.valid.end(), origin);
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    return s.work.element_cell.size();
  };
  const Vec3d rest = Vec3d::Ones(), torn(5.2, 0.45, 0.45), crushed(0.19, 2.3, 2.3), inverted(1, 1, -1);
  const std::size_t all = elements(solid::kKnown, rest);
  CHECK(all > 300);
  CHECK(elements(solid::kEdge, rest) == all);
  CHECK(elements(solid::kEdge, Vec3d(4.8, 0.5, 0.5)) > 100);
  CHECK(s.work.rejected == 0);
  CHECK(elements(solid::kExtrapolated, rest) == 0);
  CHECK(s.work.rejected > 300);
  CHECK(s.work.volume == 0.0);
  for (const Vec3d& stretch : {torn, crushed, inverted}) {
    CHECK(elements(solid::kKnown, stretch) > 100);  // given as it is
    CHECK(s.work.rejected == 0);
    CHECK(elements(solid::kEdge, stretch) == 0);
    CHECK(s.work.rejected > 100);
  }
}

TEST_CASE("Of what has yielded the elastic part is asked whether it is in shape") {
  TestSolid s = make_ball(cube_grid(18, 0.02), kSoft, Vec3d::Constant(0.18), 0.1);
  s.rest.plastic = {1000.0, 1000.0, 0.0};
  s.rest.lattice = solid::make_material_lattice(Vec3d::Constant(-0.9), Vec3d::Constant(1.3), 0.05);
  const auto elements = [&](const Vec3d& stretch, const Vec3d& yielded) {
    const Vec3d center = Vec3d::Constant(0.18);
    set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - center - (x - center).cwiseQuotient(stretch); });
    std::fill(s.state.valid.begin(), s.state.valid.end(), solid::kEdge);
    const auto log = [&](int a) { return static_cast<Real>(std::log(yielded[a])); };
    s.state.plastic.assign(s.rest.lattice.node_count(), {{log(0), log(1), 0, 0, 0}, 1});
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    return s.work.element_cell.size();
  };
  const Vec3d rest = Vec3d::Ones(), flat(2.5, 2.5, 0.16);
  CHECK(elements(flat, rest) == 0);
  CHECK(elements(flat, flat) > 100);
  CHECK(s.work.rejected == 0);
  CHECK(elements(rest, flat) == 0);  // pulled back to where it was it is strained as much
  CHECK(elements(Vec3d(-2.5, 2.5, 0.16), flat) == 0);
}

TEST_CASE("What a known cell far away holds is not held a second time") {
  // A ball, and beside it, behind nodes without data, a second map of the part of it around `from`.
  const grid::Grid g = cube_grid(40, 0.02);
  const Vec3d center(0.16, 0.4, 0.4), second(0.6, 0.4, 0.4);
  const auto elements = [&](std::uint8_t origin, const Vec3d& from, int last_known, int threads) {
    TestSolid s = make_ball(g, kSoft, center, 0.1);
    set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x[0] < 0.45 ? Vec3d::Zero() : Vec3d(second - from); });
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i)
          if (i > last_known)
            s.state.valid[g.node(i, j, k)] =
                (g.node_position(i, j, k) - second).cwiseAbs().maxCoeff() < 0.051 ? origin : solid::kNoData;
    solid::compute_mass(Parallel(threads), s.rest, s.state, s.work);
    return s;
  };
  const TestSolid alone = elements(solid::kNoData, center, 15, 1);
  const std::size_t ball = alone.work.element_cell.size();
  CHECK(ball > 400);
  CHECK(alone.work.rejected == 0);
  for (const int threads : {1, 3}) {
    const TestSolid copied = elements(solid::kEdge, center, 15, threads);  // 4 x 4 x 4 cells around the middle
    CHECK(copied.work.rejected == 64);
    CHECK(copied.work.fraction == alone.work.fraction);
    CHECK(copied.work.mass == alone.work.mass);
  }
  CHECK(elements(solid::kKnown, center, 15, 1).work.fraction == alone.work.fraction);  // nor as a part of its own
  // But where the ball has lost it.
  const std::size_t half = elements(solid::kNoData, center, 8, 1).work.element_cell.size();
  CHECK(half == ball / 2);
  const TestSolid moved = elements(solid::kEdge, center + Vec3d(0.06, 0, 0), 8, 1);
  CHECK(moved.work.element_cell.size() > half + 50);
  CHECK(moved.work.rejected == 0);
}

TEST_CASE("Cells beside a solid that moves, turns and stretches are no copies", "[law]") {
  TestSolid s = make_ball(cube_grid(30, 0.02), kSoft, Vec3d::Constant(0.3), 0.1);
  const auto& g = s.state.band.grid;
  for (const double stretch : {1.0, 2.0, 4.5}) {
    Mat3d inverse = Vec3d(1 / stretch, std::sqrt(stretch), std::sqrt(stretch)).asDiagonal();
    inverse *= Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    set_displacement(
        s, [&](const Vec3d& x) -> Vec3d { return x - Vec3d::Constant(0.3) - inverse * (x - Vec3d::Constant(0.305)); });
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    const auto fraction = s.work.fraction;
    for (int k = 0; k <= g.cells[2]; ++k)  // half of it at the edge of the data
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 15; i <= g.cells[0]; ++i) s.state.valid[g.node(i, j, k)] = solid::kEdge;
    solid::compute_mass(Parallel(2), s.rest, s.state, s.work);
    CHECK(s.work.rejected == 0);
    CHECK(s.work.fraction == fraction);
  }
}

TEST_CASE("A splinter that has changed its volume is taken away, one that has not stays") {
  // Half a ball, and beside it up to four cells of the other half's end, at stretch s.
  const grid::Grid g = cube_grid(18, 0.02);
  const Vec3d center(0.14, 0.18, 0.18);
  const auto elements = [&](int cells, double stretch, std::uint8_t origin) {
    TestSolid s = make_ball(g, kSoft, center, 0.1);
    const Vec3d from(13 * g.h, 9 * g.h, 9 * g.h), to = from + g.h * Vec3d(cells, 1, 1);
    const auto in_splinter = [&](const Vec3d& x) {
      return (x - from).minCoeff() > -1e-6 && (to - x).minCoeff() > -1e-6;
    };
    set_displacement(s, [&](const Vec3d& x) -> Vec3d {
      return in_splinter(x) ? Vec3d(x - center - Vec3d(0.025, 0, 0) - (x - from) / stretch) : Vec3d::Zero();
    });
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i)
          if (in_splinter(g.node_position(i, j, k)))
            s.state.valid[s.state.band.grid.node(i, j, k)] = origin;
          else if (i > 7)
            s.state.valid[s.state.band.grid.node(i, j, k)] = solid::kNoData;
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    CHECK((s.work.rejected == 0 || s.work.rejected == static_cast<std::uint64_t>(cells)));
    return s.work.element_cell.size();
  };
  const std::size_t ball = elements(3, 1.4, solid::kEdge);
  for (int cells = 1; cells <= 3; ++cells) {
    CHECK(elements(cells, 1.4, solid::kEdge) == ball);
    CHECK(elements(cells, 1.0, solid::kEdge) == ball + static_cast<std::size_t>(cells));
    CHECK(elements(cells, 1.4, solid::kKnown) == ball + static_cast<std::size_t>(cells));
  }
  CHECK(elements(4, 1.4, solid::kEdge) == ball + 4);
}

TEST_CASE("A band surrounds its solid, stays in the grid and takes its data along when it moves") {
  const grid::Grid g = cube_grid(40, 0.1);
  const solid::Band band = solid::make_band(g, {10, 2, 30}, {15, 8, 39});
  CHECK(band.grid.lo == Vec3i{10 - solid::kBandMargin, 0, 30 - solid::kBandMargin});
  CHECK(band.grid.cells == Vec3i{5 + 2 * solid::kBandMargin, 8 + solid::kBandMargin, 10 + solid::kBandMargin});
  CHECK((band.grid.origin - g.node_position(band.grid.lo[0], band.grid.lo[1], band.grid.lo[2])).norm() < 1e-12);
  solid::SolidState state;
  solid::move_band(state, band);
  CHECK(std::count(state.valid.begin(), state.valid.end(), 1) == 0);
  state.u.set(band.grid.node(6, 3, 4), Vec3(1, 2, 3));
  state.valid[band.grid.node(6, 3, 4)] = 1;
  state.stiff.assign(band.grid.cell_count(), 0);
  state.stiff[band.grid.cell(6, 3, 4)] = 1;
  const solid::Band next = solid::make_band(g, {12, 2, 28}, {17, 8, 37});
  solid::move_band(state, next);
  CHECK(std::count(state.valid.begin(), state.valid.end(), 1) == 1);
  const std::size_t n = next.grid.node(6 + band.grid.lo[0] - next.grid.lo[0], 3, 4 + band.grid.lo[2] - next.grid.lo[2]);
  CHECK(state.valid[n] == 1);
  CHECK(state.u.at(n) == Vec3(1, 2, 3));
  CHECK(state.stiff.size() == next.grid.cell_count());
  CHECK(std::count(state.stiff.begin(), state.stiff.end(), 1) == 1);
  CHECK(state.stiff[next.grid.cell(6 + band.grid.lo[0] - next.grid.lo[0], 3, 4 + band.grid.lo[2] - next.grid.lo[2])] ==
        1);
}
