// Purpose: the stiffness of a block of elements against its slow twin, element by element.
#include <catch2/catch.hpp>
#include <random>

#include "solid/material_force.hpp"
#include "solid/stiffness_block.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

TEST_CASE("solid: a block of elements has the stiffness of its elements", "[solid]") {
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
    const double factor = 0.7;
    for (std::size_t b = 0; b < s.work.blocks(); ++b) {
      Real in[24][solid::kBlock], out[24 * solid::kBlock];
      for (auto& row : in)
        for (Real& value : row) value = static_cast<Real>(normal(random));
      solid::block_stiffness(s.work, b, h, static_cast<Real>(factor), in, out);
      for (std::size_t lane = 0; lane < solid::kBlock; ++lane) {
        const std::size_t e = b * solid::kBlock + lane;
        Real one_in[24], one_out[24] = {};
        for (std::size_t i = 0; i < 24; ++i) one_in[i] = in[i][lane];
        if (e < elements) solid::element_stiffness(s.work, h, e, one_in, one_out);
        double size = 0.0;
        for (Real value : one_out) size = std::max(size, std::abs(static_cast<double>(value)));
        for (std::size_t i = 0; i < 24; ++i)
          REQUIRE(static_cast<double>(out[i * solid::kBlock + lane]) ==
                  Approx(factor * static_cast<double>(one_out[i])).margin(2e-6 * size));
      }
    }
  }
}
