// Purpose: the dilatation of a compressible solid's material: what it is before anything is known of it, what a step
// makes of it, and that the map's roughness is no part of it.
#include <catch2/catch.hpp>
#include <random>

#include "solid/element/dilatation.hpp"
#include "solid/element/energy.hpp"
#include "solid/element/material_lattice.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr int kAcross = 6;
constexpr double kBulkModulus = 1e6, kEdge = kAcross * kH;  // Pa, m

// A block whose pressure has a bulk stiffness, with a lattice around all that its displacements lead to.
TestSolid bulky_block() {
  TestSolid s = make_block(cube_grid(kAcross, kH), kSoft);
  s.rest.compressible = true;
  s.rest.bulk = kBulkModulus;
  s.rest.lattice = solid::make_material_lattice(Vec3d::Constant(-kEdge), Vec3d::Constant(2.0 * kEdge), kH);
  s.state.dilatation.resize(s.rest.lattice.node_count());
  return s;
}

// A step multiplies the dilatation by growth(X), X: the centres of the elements at no displacement.
void grow(TestSolid& s, const std::function<double(const Vec3d&)>& growth, int threads = 1) {
  compute(s, 1, threads);
  const grid::Grid& g = s.state.band.grid;
  std::vector<double> next;
  for (std::size_t e = 0; e < s.work.element_corner.size(); ++e) {
    const auto [i, j, k] = g.node_place(static_cast<std::size_t>(s.work.element_corner[e]));
    next.push_back(static_cast<double>(s.work.dilatation[e]) * growth(g.cell_center(i, j, k)));
  }
  solid::carry_dilatation(Parallel(threads), s.rest, s.work, next, s.state);
}

void expect_all(TestSolid& s, double wanted, double within) {
  compute(s, 1);
  REQUIRE(!s.work.dilatation.empty());
  for (const Real value : s.work.dilatation) CHECK(static_cast<double>(value) == Approx(wanted).margin(within));
}

}  // namespace

TEST_CASE("Before the first step the dilatation is det F of the map", "[solid]") {
  TestSolid s = bulky_block();
  set_displacement(s, [](const Vec3d& x) -> Vec3d { return (1.0 - 1.0 / 1.1) * x; });
  expect_all(s, 1.331, 1e-5);
}

TEST_CASE("What a step makes of the dilatation stays with the material as it moves", "[solid]") {
  TestSolid s = bulky_block();
  grow(s, [](const Vec3d&) { return 1.02; });
  expect_all(s, 1.02, 1e-6);
  grow(s, [](const Vec3d&) { return 1.02; });
  set_displacement(s, [](const Vec3d&) { return Vec3d(0.3 * kH, -0.4 * kH, 0.17 * kH); });
  expect_all(s, 1.02 * 1.02, 1e-6);
}

TEST_CASE("A dilatation that varies along the material is read back where it was given", "[solid]") {
  TestSolid s = bulky_block();
  const auto growth = [](const Vec3d& X) { return 1.0 + 0.02 * std::sin(M_PI * X[0] / kEdge); };
  grow(s, growth);
  compute(s, 1);
  const grid::Grid& g = s.state.band.grid;
  for (std::size_t e = 0; e < s.work.dilatation.size(); ++e) {
    const auto [i, j, k] = g.node_place(static_cast<std::size_t>(s.work.element_corner[e]));
    CHECK(static_cast<double>(s.work.dilatation[e]) == Approx(growth(g.cell_center(i, j, k))).margin(1e-3));
  }
}

TEST_CASE("The roughness of a map has no bulk energy once the dilatation is known", "[solid]") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> noise(-0.01 * kH, 0.01 * kH);
  const auto energy_of = [&](TestSolid& s) {
    set_displacement(s, [&](const Vec3d&) { return Vec3d(noise(random), noise(random), noise(random)); });
    compute(s, 1);
    CHECK(solid::elastic_energy(Parallel(1), s.rest, s.state, s.work, 1) ==
          Approx(s.work.elastic_energy).epsilon(1e-5));
    return s.work.elastic_energy;
  };
  TestSolid known = bulky_block(), unknown = bulky_block(), none = bulky_block();
  grow(known, [](const Vec3d&) { return 1.0; });
  none.rest.bulk = 0.0;
  const double rough = energy_of(unknown), smooth = energy_of(known), elements = energy_of(none);
  INFO("energy " << rough << " J with det F of the map, " << smooth << " J with the dilatation, " << elements
                 << " J without bulk stiffness");
  CHECK(smooth < 1.3 * elements);  // other random numbers
  CHECK(rough > 5.0 * elements);
}

TEST_CASE("An element whose dilatation is forgotten has det F of its map, and what is further away keeps its own",
          "[solid]") {
  TestSolid s = bulky_block();
  grow(s, [](const Vec3d&) { return 1.02; });
  std::vector<double> next(s.work.element_corner.size(), 0.0);
  next.front() = solid::kForgotten;
  solid::carry_dilatation(Parallel(1), s.rest, s.work, next, s.state);
  set_displacement(s, [](const Vec3d&) { return Vec3d::Zero(); });
  compute(s, 1);
  CHECK(static_cast<double>(s.work.dilatation.front()) == Approx(1.0).margin(1e-6));
  CHECK(static_cast<double>(s.work.dilatation.back()) == Approx(1.02).margin(1e-6));
}

TEST_CASE("The dilatation has the same bits on any number of threads", "[determinism]") {
  const auto run = [](int threads) {
    TestSolid s = bulky_block();
    set_displacement(s, [](const Vec3d& x) -> Vec3d { return 0.1 * x.cwiseProduct(x) / kEdge; });
    for (int n = 0; n < 3; ++n)
      grow(
          s, [](const Vec3d& X) { return 1.0 + 0.1 * std::sin(40.0 * X.sum()); }, threads);
    return s.state.dilatation;
  };
  const std::vector<Real> one = run(1);
  CHECK(run(2) == one);
  CHECK(run(5) == one);
}
