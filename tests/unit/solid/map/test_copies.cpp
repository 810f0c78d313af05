// Purpose: which of two cells that hold the same material is the copy.
#include <catch2/catch.hpp>

#include "solid/map/copies.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// A block of 5 x 5 x 5 full cells at rest with an arm of six cells along x, and cells that a test adds.
struct Body {
  grid::Grid g = cube_grid(24, 0.5);
  std::vector<std::vector<solid::Holding>> planes{24};
  std::vector<std::uint8_t> full = std::vector<std::uint8_t>(g.cell_count());

  Body() {
    for (int k = 1; k <= 5; ++k)
      for (int j = 1; j <= 5; ++j)
        for (int i = 1; i <= (j == 3 && k == 3 ? 11 : 5); ++i) add({i, j, k}, {i + 0.5, j + 0.5, k + 0.5}, true);
  }
  // material: in cells
  void add(const Vec3i& cell, const Vec3d& material, bool known, bool is_full = true) {
    planes[static_cast<std::size_t>(cell[2])].push_back({g.h * material, cell, known});
    full[g.cell(cell[0], cell[1], cell[2])] = is_full;
  }
  bool has_copy(const Vec3i& cell) const {
    const auto copies = solid::find_copies(Parallel(2), g, planes, full, 5.0);
    CHECK(copies.size() <= 1);
    return copies == std::vector<std::size_t>{g.cell(cell[0], cell[1], cell[2])};
  }
};

const Vec3d kMiddle(3.5, 3.5, 3.5);

bool is_copy(const Vec3i& cell, const Vec3d& material, bool known, bool full = true) {
  Body body;
  body.add(cell, material, known, full);
  return body.has_copy(cell);
}

}  // namespace

TEST_CASE("A body that holds everything once has no copies") {
  const Body body;
  CHECK(solid::find_copies(Parallel(2), body.g, body.planes, body.full, 5.0).empty());
  CHECK(solid::find_copies(Parallel(2), body.g, {24, std::vector<solid::Holding>{}},
                           std::vector<std::uint8_t>(body.full.size()), 5.0)
            .empty());
}

TEST_CASE("Of two cells that hold the same the one with the weaker claim is the copy") {
  const Vec3i apart{20, 3, 3}, attached{12, 3, 3};
  for (const bool known : {false, true}) CHECK(is_copy(apart, kMiddle, known));
  CHECK(is_copy(attached, kMiddle, false));
  CHECK_FALSE(is_copy(attached, kMiddle, true));  // nothing tells which of the two is right
  CHECK(is_copy(apart, kMiddle, false, false));
  CHECK_FALSE(is_copy(apart, kMiddle, true, false));  // a cut cell that the solid brought along
  CHECK_FALSE(is_copy(apart, {20.5, 3.5, 3.5}, false));
  // The larger part is right, wherever it is, and whatever it is made of.
  Body body;
  for (auto& plane : body.planes)
    for (auto& holding : plane) holding.known = false;
  body.add(apart, kMiddle, true);
  CHECK(body.has_copy(apart));
}

TEST_CASE("Cells are copies where the solid would be stretched beyond belief between them") {
  const Vec3d side(0, 1, 0);
  for (const int cells : {3, 4}) {  // beside the block, which holds the material at 5.5
    const Vec3d held(5.5, 5.5, 3.5);
    const Vec3i cell{5, 5 + cells, 3};
    CHECK(is_copy(cell, held + (cells / 5.0 - 0.05) * side, false));
    CHECK_FALSE(is_copy(cell, held + (cells / 5.0 + 0.05) * side, false));
  }
  CHECK_FALSE(is_copy({5, 7, 3}, Vec3d(5.5, 5.5, 3.5), false));  // too near
  CHECK(is_copy({5, 20, 3}, Vec3d(5.5, 5.5 + 1.95, 3.5), false));
  CHECK_FALSE(is_copy({5, 20, 3}, Vec3d(5.5, 5.5 + 2.05, 3.5), false));  // torn off further away, no copy of anything
}
