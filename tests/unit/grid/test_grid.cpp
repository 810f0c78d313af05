// Purpose: index arithmetic, walls, ghosts and tiles.
#include <catch2/catch.hpp>
#include <set>

#include "grid/boundary.hpp"
#include "grid/tiles.hpp"

using namespace efsi;
using namespace efsi::grid;

TEST_CASE("Every node, cell and padded cell has its own index") {
  Grid g;
  g.cells = {3, 4, 5};
  std::set<std::size_t> nodes, cells, padded;
  for (int k = -1; k <= 5; ++k)
    for (int j = -1; j <= 4; ++j)
      for (int i = -1; i <= 3; ++i) {
        padded.insert(g.padded(i, j, k));
        if (i < 0 || j < 0 || k < 0) continue;
        nodes.insert(g.node(i, j, k));
        if (i < 3 && j < 4 && k < 5) cells.insert(g.cell(i, j, k));
      }
  CHECK(nodes.size() == g.node_count());
  CHECK(*nodes.rbegin() == g.node_count() - 1);
  CHECK(cells.size() == g.cell_count());
  CHECK(*cells.rbegin() == g.cell_count() - 1);
  CHECK(padded.size() == g.padded_count());
  CHECK(*padded.rbegin() == g.padded_count() - 1);
  const auto offset = corner_offsets(g);
  for (std::size_t a = 0; a < 8; ++a)
    CHECK(g.node(1, 2, 3) + offset[a] == g.node(1 + kCorner[a][0], 2 + kCorner[a][1], 3 + kCorner[a][2]));
}

TEST_CASE("Slip walls fix the normal component, no-slip walls all, open and periodic ones none") {
  Grid g;
  g.cells = {4, 4, 4};
  Walls walls;
  walls.face = {Wall::kSlip, Wall::kNoSlip, Wall::kOpen, Wall::kSlip, Wall::kPeriodic, Wall::kPeriodic};
  CHECK(fixed_components(g, walls, 2, 2, 2) == 0u);
  CHECK(fixed_components(g, walls, 0, 2, 2) == 1u);
  CHECK(fixed_components(g, walls, 4, 2, 2) == 7u);
  CHECK(fixed_components(g, walls, 2, 0, 2) == 0u);
  CHECK(fixed_components(g, walls, 2, 4, 2) == 2u);
  CHECK(fixed_components(g, walls, 2, 2, 0) == 0u);
  CHECK(fixed_components(g, walls, 0, 4, 4) == 3u);
  CHECK(fixed_components(g, walls, 4, 0, 0) == 7u);
  // Solids slide on no-slip walls.
  CHECK(fixed_for_solid(g, walls, 4, 2, 2) == 1u);
  const auto all = fixed_by_walls(g, walls);
  for (int k = 0; k <= 4; ++k)
    for (int j = 0; j <= 4; ++j)
      for (int i = 0; i <= 4; ++i) CHECK(all[g.node(i, j, k)] == fixed_components(g, walls, i, j, k));
}

TEST_CASE("Ghost cells repeat periodic axes and hold the outside value elsewhere") {
  Grid g;
  g.cells = {3, 4, 5};
  g.periodic = {true, false, true};
  std::vector<Real> field(g.padded_count(), -1);
  const auto value = [](int i, int j, int k) { return static_cast<Real>(1 + i + 10 * j + 100 * k); };
  for (int k = 0; k < 5; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 3; ++i) field[g.padded(i, j, k)] = value(i, j, k);
  fill_ghosts(g, field, Real(0));
  for (int k = -1; k <= 5; ++k)
    for (int j = -1; j <= 4; ++j)
      for (int i = -1; i <= 3; ++i) {
        const Real expected = j < 0 || j > 3 ? Real(0) : value((i + 3) % 3, j, (k + 5) % 5);
        CHECK(field[g.padded(i, j, k)] == expected);
      }
}

TEST_CASE("Tiles cover every point once") {
  const TileMask tiles(Vec3i{17, 8, 9});
  CHECK(tiles.count() == 3 * 1 * 2);
  std::set<std::array<int, 3>> seen;
  for (std::int64_t t = 0; t < tiles.count(); ++t) {
    Vec3i begin, end;
    tiles.range(t, begin, end);
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j)
        for (int i = begin[0]; i < end[0]; ++i) CHECK(seen.insert({i, j, k}).second);
  }
  CHECK(seen.size() == 17u * 8u * 9u);
}

TEST_CASE("Dilation activates the 26 neighbours, across periodic faces too") {
  TileMask tiles(Vec3i{32, 32, 32});  // 4^3 tiles
  const auto index = [](int i, int j, int k) { return std::int64_t{i + 4 * (j + 4 * k)}; };
  tiles.set(index(1, 1, 1), true);
  tiles.dilate({false, false, false});
  CHECK(tiles.active_count() == 27);
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) CHECK(tiles.active(index(i, j, k)) == (i < 3 && j < 3 && k < 3));
  TileMask corner(Vec3i{32, 32, 32});
  corner.set(index(0, 0, 0), true);
  TileMask wrapped = corner;
  corner.dilate({false, false, false});
  CHECK(corner.active_count() == 8);
  wrapped.dilate({true, false, false});
  CHECK(wrapped.active_count() == 12);
  CHECK(wrapped.active(index(3, 1, 1)));
}
