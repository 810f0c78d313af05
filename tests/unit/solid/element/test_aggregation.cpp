// Purpose: the stiffness of cells that are no elements goes to the elements beside them, none of it twice or nowhere.
#include <catch2/catch.hpp>

#include "solid/element/aggregation.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// Cells of a grid; none has any solid before it is added.
struct Cells {
  grid::Grid grid = cube_grid(4, 0.1);
  solid::SolidWork work;

  Cells() {
    work.fraction.assign(grid.cell_count(), 0);
    work.volume_ratio.assign(grid.cell_count(), 1);
    work.element.assign(grid.cell_count(), -1);
  }
  std::size_t add(const Vec3i& at, Real fraction, Real volume_ratio, bool element) {
    const std::size_t c = grid.cell(at[0], at[1], at[2]), e = work.element_cell.size();
    work.fraction[c] = fraction;
    work.volume_ratio[c] = volume_ratio;
    if (!element) return e;
    work.element[c] = static_cast<std::int32_t>(e);
    work.element_cell.push_back(static_cast<std::int32_t>(c));
    work.element_factor.push_back(static_cast<double>(fraction));
    return e;
  }
};

}  // namespace

TEST_CASE("A cut cell makes the elements over its faces stiffer, else those over its edges, else over its corners") {
  Cells cells;
  const std::size_t below = cells.add({1, 0, 1}, Real(0.8), 2, true), beside = cells.add({0, 1, 1}, 1, 1, true),
                    aslant = cells.add({0, 0, 1}, 1, 1, true);
  cells.add({1, 1, 1}, Real(0.2), 1, false);  // two elements over its faces
  solid::stiffen_beside_cuts(cells.grid, cells.work);
  CHECK(cells.work.element_factor[below] == Approx(0.8 + 2 * 0.1));  // it holds half of its volume at rest
  CHECK(cells.work.element_factor[beside] == Approx(1.1));
  CHECK(cells.work.element_factor[aslant] == 1.0);

  Cells edge;
  const std::size_t over_edge = edge.add({1, 1, 1}, 1, 1, true), over_corner = edge.add({1, 1, 3}, 1, 1, true);
  edge.add({2, 2, 1}, Real(0.2), 1, false);
  edge.add({2, 2, 2}, Real(0.4), 2, false);  // over corners of both
  solid::stiffen_beside_cuts(edge.grid, edge.work);
  CHECK(edge.work.element_factor[over_edge] == Approx(1.0 + 0.2 + 0.1));
  CHECK(edge.work.element_factor[over_corner] == Approx(1.1));

  Cells none;
  const std::size_t far = none.add({0, 0, 0}, 1, 1, true);
  none.add({2, 0, 0}, Real(0.2), 1, false);
  solid::stiffen_beside_cuts(none.grid, none.work);
  CHECK(none.work.element_factor[far] == 1.0);
}

TEST_CASE("The elements of a ball have the stiffness of all of its cells, wherever it lies between nodes", "[law]") {
  TestSolid s = make_ball(cube_grid(26, 0.01), kSoft, Vec3d::Constant(0.13), 0.1);
  s.rest.stiff_by_part = true;
  for (int shift = 0; shift < 12; ++shift) {
    const Vec3d t = 0.01 * Vec3d(shift / 12.0, 0.37 * shift / 12.0, -0.71 * shift / 12.0);
    set_displacement(s, [&](const Vec3d&) { return t; });
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    double held = 0.0, stiff = 0.0;
    for (std::size_t c = 0; c < s.work.fraction.size(); ++c)
      held += static_cast<double>(s.work.fraction[c]) / static_cast<double>(s.work.volume_ratio[c]);
    for (std::size_t e = 0; e < s.work.element_cell.size(); ++e)
      stiff +=
          s.work.factor(e) / static_cast<double>(s.work.volume_ratio[static_cast<std::size_t>(s.work.element_cell[e])]);
    CHECK(stiff == Approx(held).epsilon(1e-6));
    CHECK(s.work.element_weight == Approx(1.0).epsilon(5e-3));
  }
}
