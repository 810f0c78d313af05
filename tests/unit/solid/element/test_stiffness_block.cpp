// Purpose: forces and stiffness of a block of elements against their slow twins, element by element.
#include <catch2/catch.hpp>
#include <random>

#include "solid/element/material_force.hpp"
#include "solid/element/stiffness_block.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

void check_lane(const Real* block, std::size_t lane, double factor, const Real (&one)[24]) {
  double size = 0.0;
  for (Real value : one) size = std::max(size, std::abs(static_cast<double>(value)));
  for (std::size_t i = 0; i < 24; ++i)
    REQUIRE(static_cast<double>(block[i * solid::kBlock + lane]) ==
            Approx(factor * static_cast<double>(one[i])).margin(2e-6 * size));
}

}  // namespace

TEST_CASE("solid: a block of elements has the stiffness and the forces of its elements", "[solid]") {
  for (const int points : {1, 8}) {
    const double h = 0.05;
    // 27 elements: one full block and one with free lanes
    TestSolid s = make_block(cube_grid(3, h), material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3));
    set_displacement(s, [](const Vec3d& x) {
      return Vec3d(0.02 * std::sin(9 * x[1]), 0.3 * x[2] * x[0], -0.2 * x[1] + 0.1 * x[0] * x[2]);
    });
    compute(s, points);
    const std::size_t elements = s.work.element_cell.size();
    REQUIRE(elements == 27);
    REQUIRE(s.work.blocks() == 2);

    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    Real factors[solid::kBlock];
    for (std::size_t lane = 0; lane < solid::kBlock; ++lane)
      factors[lane] = Real(0.7) + Real(0.01) * static_cast<Real>(lane);
    for (std::size_t b = 0; b < s.work.blocks(); ++b) {
      Real in[24][solid::kBlock], out[24 * solid::kBlock], diagonal[24 * solid::kBlock], force[24 * solid::kBlock];
      for (auto& row : in)
        for (Real& value : row) value = static_cast<Real>(normal(random));
      solid::block_stiffness(s.work, b, h, factors, in, out);
      solid::block_stiffness_diagonal(s.work, b, h, factors, diagonal);
      solid::block_force(s.state, s.work, b, force);
      for (std::size_t lane = 0; lane < solid::kBlock; ++lane) {
        const std::size_t e = b * solid::kBlock + lane;
        Real one_in[24], one_out[24] = {}, one_diagonal[24] = {}, one_force[24] = {};
        for (std::size_t i = 0; i < 24; ++i) one_in[i] = in[i][lane];
        if (e < elements) {
          solid::element_stiffness(s.work, h, e, one_in, one_out);
          solid::element_stiffness_diagonal(s.work, h, e, one_diagonal);
          solid::element_force(s.state, s.work, e, one_force);
        }
        check_lane(out, lane, factors[lane], one_out);
        check_lane(diagonal, lane, factors[lane], one_diagonal);
        check_lane(force, lane, 1.0, one_force);
      }
    }
  }
}
