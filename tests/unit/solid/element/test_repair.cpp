// Purpose: broken cells of an incompressible solid are put back in shape.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "solid/element/material_lattice.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/element/repair.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kFine = 0.02;  // size of the cells [m]
const Vec3d kCenter = Vec3d::Constant(0.24);

// A ball of ten cells across, stretched by f.
TestSolid stretched_ball(const Mat3d& f) {
  TestSolid s = make_ball(cube_grid(24, kFine), kSoft, kCenter, 0.1);
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

// Moves the map of the ball's middle node by that many cells: those around it are crushed, turned over and torn.
void disturb(TestSolid& s, double cells) {
  const grid::Grid& g = s.state.band.grid;
  const std::size_t n = g.node(12, 12, 12);
  s.state.u.set(n, s.state.u.at(n) + Vec3(Real(cells * kFine), Real(0.4 * kFine), 0));
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
}

// The largest factor by which a cell inside is off from the volume of the solid.
double worst_growth(const TestSolid& s) {
  const double mean = s.rest.density * s.work.volume / s.work.total_mass;
  double worst = 1.0;
  for (const auto cell : s.work.element_cell) {
    const auto c = static_cast<std::size_t>(cell);
    if (s.work.fraction[c] < Real(1)) continue;
    const double det = static_cast<double>(s.work.volume_ratio[c]) / mean;
    worst = std::max({worst, det, 1.0 / det});
  }
  return worst;
}

// Cells from the middle node along the axis on which a node is farthest away.
int distance(const grid::Grid& g, std::size_t n) {
  const auto [i, j, k] = g.node_place(n);
  return std::max({std::abs(i - 12), std::abs(j - 12), std::abs(k - 12)});
}

std::uint64_t repair(TestSolid& s, int threads = 1) {
  return solid::repair_map(Parallel(threads), s.rest, s.state, s.work);
}

}  // namespace

TEST_CASE("Broken cells are put back in shape and nothing far from them changes", "[law]") {
  for (const double growth : {0.9, 1.0, 1.1})
    for (const double cells : {1.6, 3.0, 6.0}) {
      CAPTURE(growth, cells);
      TestSolid s = stretched_ball(std::cbrt(growth) * volume_preserving());
      const double volume = s.work.volume;
      disturb(s, cells);
      const auto disturbed = s.state.u.c;
      REQUIRE(worst_growth(s) > solid::kMostGrowth);
      CHECK(repair(s) >= 2);
      CHECK(worst_growth(s) <= solid::kMostGrowth);
      CHECK(s.work.volume == Approx(volume).epsilon(1e-3));
      const grid::Grid& g = s.state.band.grid;
      for (std::size_t n = 0; n < g.node_count(); ++n)
        if (distance(g, n) > 3)
          for (std::size_t a = 0; a < 3; ++a) REQUIRE(s.state.u.c[a][n] == disturbed[a][n]);
      CHECK(repair(s) == 0);
    }
}

TEST_CASE("Cells of what has yielded are put back by their elastic part, which makes no energy", "[law]") {
  const Vec3d flat(2.0, 2.0, 0.25);
  TestSolid s = make_ball(cube_grid(24, kFine), kSoft, kCenter, 0.1);
  s.rest.plastic = {1000.0, 1000.0, 0.0};
  s.rest.lattice = solid::make_material_lattice(Vec3d::Constant(-1.0), Vec3d::Constant(1.5), 0.1);
  const auto log = [&](int a) { return static_cast<Real>(std::log(flat[a])); };
  s.state.plastic.assign(s.rest.lattice.node_count(), {{log(0), log(1), 0, 0, 0}, 1});
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - kCenter - (x - kCenter).cwiseQuotient(flat); });
  const auto energy = [&] {
    solid::compute_material(Parallel(1), s.rest, s.state, 1, s.work);
    return s.work.elastic_energy;
  };
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const double sound = energy();
  disturb(s, 0.6);  // 1.2 cells of the flat ball
  const double broken = energy();
  REQUIRE(worst_growth(s) > solid::kMostGrowth);
  REQUIRE(broken > sound);
  CHECK(repair(s) >= 1);
  CHECK(worst_growth(s) <= solid::kMostGrowth);
  CHECK(energy() < broken);
}

TEST_CASE("Around broken cells the velocity becomes smooth", "[law]") {
  TestSolid s = stretched_ball(volume_preserving());
  const grid::Grid& g = s.state.band.grid;
  const Vec3 drift(Real(0.3), Real(-0.7), Real(0.1));
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const Real sign = n % 2 ? Real(1) : Real(-1);  // along x
    s.state.v.set(n, drift + (distance(g, n) <= 2 ? Vec3(0, sign, 0) : Vec3::Zero()));
  }
  const auto noisy = s.state.v;
  disturb(s, 1.6);
  REQUIRE(repair(s) > 0);
  CHECK((s.state.v.at(g.node(12, 12, 12)) - drift).norm() < Real(0.05));
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    REQUIRE((s.state.v.at(n) - drift).norm() <= (noisy.at(n) - drift).norm() + Real(0.5));
    if (distance(g, n) > 4) REQUIRE(s.state.v.at(n) == drift);
  }
}

TEST_CASE("A solid in shape is left as it is, also when it is far from its volume as a whole") {
  for (const Mat3d& f : {volume_preserving(), Mat3d(Vec3d(1, 0.45, 1).asDiagonal()), Mat3d(2.2 * Mat3d::Identity())}) {
    TestSolid s = stretched_ball(f);
    const auto u = s.state.u.c;
    CHECK(repair(s) == 0);
    CHECK((s.state.u.c == u));
  }
}

TEST_CASE("A whole solid is judged by what it weighs, not by what its cells count") {
  for (const double growth : {1.0, 2.0}) {  // of the solid; its map says 2
    CAPTURE(growth);
    TestSolid s = stretched_ball(std::cbrt(2.0) * Mat3d::Identity());
    s.state.whole = 1;
    s.rest.mass_volume = s.work.volume / growth;
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    CHECK((repair(s) > 0) == (growth == 1.0));
  }
}

TEST_CASE("Compressible solids are not repaired") {
  TestSolid s = stretched_ball(volume_preserving());
  s.rest.compressible = true;
  disturb(s, 1.6);
  const auto u = s.state.u.c;
  CHECK(repair(s) == 0);
  CHECK((s.state.u.c == u));
}

TEST_CASE("A solid without a sound cell comes out of its repair with finite values") {
  TestSolid s = make_block(cube_grid(9, kFine), kSoft);
  const grid::Grid& g = s.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)  // of three planes of cells two are turned over and one is crushed
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        s.state.u.set(g.node(i, j, k), Vec3(static_cast<Real>((2 * (i % 3) - 2) * kFine), 0, 0));
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  REQUIRE(s.work.element_cell.size() > 100);
  CHECK(repair(s) > 100);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t n = 0; n < g.node_count(); ++n) {
      REQUIRE(std::isfinite(s.state.u.c[a][n]));
      REQUIRE(std::isfinite(s.state.v.c[a][n]));
    }
}

TEST_CASE("A repair has the same bits for any number of threads") {
  TestSolid one = stretched_ball(volume_preserving());
  disturb(one, 3);
  const std::uint64_t cells = repair(one);
  for (const int threads : {2, 3}) {
    TestSolid s = stretched_ball(volume_preserving());
    disturb(s, 3);
    CHECK(repair(s, threads) == cells);
    CHECK((s.state.u.c == one.state.u.c));
    CHECK((s.state.v.c == one.state.v.c));
    CHECK((s.work.mass == one.work.mass));
  }
}

TEST_CASE("Broken cells are counted before they are put back") {
  TestSolid s = stretched_ball(volume_preserving());
  CHECK(solid::inspect_map(s.rest, s.work).broken == 0);
  CHECK(solid::inspect_map(s.rest, s.work).max_det_f == Approx(1.0).epsilon(1e-3));
  disturb(s, 3.0);
  const solid::MapQuality before = solid::inspect_map(s.rest, s.work);
  CHECK(before.broken >= 2);
  CHECK(std::max(before.max_det_f, 1.0 / before.min_det_f) > solid::kMostGrowth);
  repair(s);
  CHECK(solid::inspect_map(s.rest, s.work).broken == 0);
  s.rest.compressible = true;  // its volume is its own
  disturb(s, 3.0);
  CHECK(solid::inspect_map(s.rest, s.work).broken == 0);
  CHECK(solid::inspect_map(s.rest, s.work).min_det_f < 0.9);
}
