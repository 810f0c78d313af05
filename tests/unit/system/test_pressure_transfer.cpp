// Purpose: what the levels of the pressure multigrid hand to each other.
#include <catch2/catch.hpp>
#include <cmath>

#include "system/pressure_transfer.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

struct TwoGrids {
  PressureCase coarse_case;
  system::PressureGrid fine, coarse;
};

TwoGrids two_grids(const PressureCase& c) {
  const Vec3i half{(c.g.cells[0] + 1) / 2, (c.g.cells[1] + 1) / 2, (c.g.cells[2] + 1) / 2};
  TwoGrids grids{PressureCase(c.name, half, c.walls.face, 1.0), {}, {}};
  grids.coarse_case.g.h = 2.0 * c.g.h;
  grids.fine = {c.g, c.walls, {}, std::vector<Real>(c.g.padded_count(), 1), {1, 1, 1}};
  grids.coarse = {
      grids.coarse_case.g, c.walls, {}, std::vector<Real>(grids.coarse_case.g.padded_count(), 1), {1, 1, 1}};
  return grids;
}

}  // namespace

TEST_CASE("Restriction is the transpose of prolongation, for every kind of wall, even and odd numbers of cells") {
  for (const Vec3i& cells : {Vec3i{16, 12, 14}, Vec3i{13, 15, 17}, Vec3i{14, 13, 12}})
    for (const PressureCase& c : pressure_cases(cells, 1.0)) {
      if ((c.g.periodic[0] && cells[0] % 2) || (c.g.periodic[1] && cells[1] % 2) || (c.g.periodic[2] && cells[2] % 2))
        continue;
      INFO(c.name << " " << cells[0] << " " << cells[1] << " " << cells[2]);
      const TwoGrids grids = two_grids(c);
      const std::vector<Real> r = c.random_cells(3), x = grids.coarse_case.random_cells(4);
      std::vector<Real> restricted(x.size(), 0), prolonged(r.size(), 0);
      system::restrict_residual(Parallel(1), grids.fine, r, grids.coarse, restricted);
      system::prolong_and_add(Parallel(1), grids.coarse, x, grids.fine, prolonged);
      const double size = std::sqrt(c.dot(r, r) * c.dot(prolonged, prolonged));
      CHECK(std::abs(grids.coarse_case.dot(restricted, x) - c.dot(r, prolonged)) < 1e-6 * size);
    }
}

TEST_CASE("A pressure that falls to nothing at an open wall, evenly, is prolonged exactly") {
  // From whole outermost cells and, along y, from those that an odd number of cells left.
  const PressureCase c = pressure_cases({16, 12, 14}, 1.0)[2];
  TwoGrids grids = two_grids(c);
  grids.fine.outer[1] = 0.75;
  for (std::size_t a = 0; a < 3; ++a) grids.coarse.outer[a] = 0.5 * (grids.fine.outer[a] + 1.0);
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const bool upper : {false, true}) {
      INFO("axis " << axis << (upper ? ", upper" : ", lower") << " wall");
      const auto pressure = [&](const system::PressureGrid& level, int i, int j, int k) {
        const int cell[3] = {i, j, k}, depth = upper ? level.grid.cells[axis] - 1 - cell[axis] : cell[axis];
        return static_cast<Real>(level.grid.h * (depth + level.outer[axis] - 0.5));
      };
      std::vector<Real> x(grids.coarse.grid.padded_count(), 0), prolonged(c.g.padded_count(), 0);
      const Vec3i& n = grids.coarse.grid.cells;
      for (int k = 0; k < n[2]; ++k)
        for (int j = 0; j < n[1]; ++j)
          for (int i = 0; i < n[0]; ++i) x[grids.coarse.grid.padded(i, j, k)] = pressure(grids.coarse, i, j, k);
      system::prolong_and_add(Parallel(1), grids.coarse, x, grids.fine, prolonged);
      // From this wall to the middle; the other two axes away from their walls.
      const Vec3i middle{c.g.cells[0] / 2, c.g.cells[1] / 2, c.g.cells[2] / 2};
      for (int depth = 0; depth < middle[axis]; ++depth) {
        Vec3i cell = middle;
        cell[axis] = upper ? c.g.cells[axis] - 1 - depth : depth;
        CHECK(static_cast<double>(prolonged[c.g.padded(cell[0], cell[1], cell[2])]) ==
              Approx(static_cast<double>(pressure(grids.fine, cell[0], cell[1], cell[2]))).epsilon(1e-5));
      }
    }
}
