// Purpose: broken cells of an incompressible solid take the map of the solid around them.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "solid/repair.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kH = 0.02;
const Vec3d kCenter = Vec3d::Constant(0.24);
const material::Elastic kSoft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);

// A ball of ten cells across, stretched by f.
TestSolid stretched_ball(const Mat3d& f) {
  TestSolid s = make_ball(cube_grid(24, kH), kSoft, kCenter, 0.1);
  const Mat3d inverse = f.inverse();
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - kCenter - inverse * (x - kCenter); });
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  return s;
}

Mat3d volume_preserving() {
  Mat3d f;
  f << 1.3, 0.2, 0.0, 0.1, 0.9, -0.1, 0.0, 0.2, 1.1;
  return f / std::cbrt(f.determinant());
}

// Moves the map of the ball's middle node by 1.6 cells: cells around it are crushed, turned over and torn.
void disturb(TestSolid& s) {
  const grid::Grid& g = s.state.band.grid;
  const std::size_t n = g.node(12, 12, 12);
  s.state.u.set(n, s.state.u.at(n) + Vec3(Real(1.6 * kH), Real(0.4 * kH), 0));
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
}

std::uint64_t repair(TestSolid& s, int threads = 1) {
  return solid::repair_map(Parallel(threads), s.rest, s.state, s.work);
}

}  // namespace

TEST_CASE("Broken cells take the linear map of the solid around them", "[law]") {
  const TestSolid sound = stretched_ball(volume_preserving());
  TestSolid s = stretched_ball(volume_preserving());
  disturb(s);
  const auto worst = [&s] {  // |ln det F| of the cells around the node
    double top = 0.0;
    for (const auto& c : grid::kCorner) {
      const std::size_t cell = s.state.band.grid.cell(11 + c[0], 11 + c[1], 11 + c[2]);
      top = std::max(top, std::abs(std::log(static_cast<double>(s.work.volume_ratio[cell]))));
    }
    return top;
  };
  CHECK(worst() > std::log(solid::kMostGrowth));
  const std::uint64_t cells = repair(s);
  CHECK(cells >= 2);
  CHECK(cells <= 8);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t n = 0; n < s.state.u.c[a].size(); ++n)
      REQUIRE(std::abs(static_cast<double>(s.state.u.c[a][n] - sound.state.u.c[a][n])) < 1e-5 * kH);
  CHECK((s.state.v.c == sound.state.v.c));
  CHECK(worst() < 1e-4);
  CHECK(s.work.volume == Approx(sound.work.volume).epsilon(1e-6));
  CHECK(s.work.counted_mass == Approx(sound.work.counted_mass).epsilon(1e-6));  // computed anew
  CHECK(repair(s) == 0);
}

TEST_CASE("A solid in shape is left as it is, also when it is far from its volume as a whole") {
  for (const Mat3d& f : {volume_preserving(), Mat3d(Vec3d(1, 0.45, 1).asDiagonal()), Mat3d(2.2 * Mat3d::Identity())}) {
    TestSolid s = stretched_ball(f);
    const auto u = s.state.u.c;
    CHECK(repair(s) == 0);
    CHECK((s.state.u.c == u));
  }
}

TEST_CASE("Compressible solids, and solids without a sound node, are not repaired") {
  TestSolid s = stretched_ball(volume_preserving());
  s.rest.compressible = true;
  disturb(s);
  const auto u = s.state.u.c;
  CHECK(repair(s) == 0);
  CHECK((s.state.u.c == u));

  // Of three planes of cells two are turned over and one is crushed.
  TestSolid all = make_block(cube_grid(9, kH), kSoft);
  const grid::Grid& g = all.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        all.state.u.set(g.node(i, j, k), Vec3(static_cast<Real>((2 * (i % 3) - 2) * kH), 0, 0));
  solid::compute_mass(Parallel(1), all.rest, all.state, all.work);
  REQUIRE(all.work.element_cell.size() > 100);
  const auto before = all.state.u.c;
  CHECK(repair(all) == 0);
  CHECK((all.state.u.c == before));
}

TEST_CASE("A repair has the same bits for any number of threads") {
  TestSolid one = stretched_ball(volume_preserving());
  disturb(one);
  const std::uint64_t cells = repair(one);
  for (const int threads : {2, 3}) {
    TestSolid s = stretched_ball(volume_preserving());
    disturb(s);
    CHECK(repair(s, threads) == cells);
    CHECK((s.state.u.c == one.state.u.c));
    CHECK((s.work.mass == one.work.mass));
  }
}
