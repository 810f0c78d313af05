// Purpose: which walls hold a solid, for the frame of its transport.
#include <catch2/catch.hpp>

#include "transport/wall_frames.hpp"

using namespace efsi;

TEST_CASE("A solid's frame is anchored in the walls of its own rows, and at its centre along the other axes") {
  grid::Grid box;
  box.cells = {10, 20, 30};
  box.h = 0.1;
  box.origin = {1.0, 2.0, 3.0};
  const auto row = [](std::size_t solid, int axis, Real out) {
    sim::WallRow r;
    r.solid = solid, r.axis = axis, r.out = out;
    return r;
  };
  // Solid 0 on the floor and below the ceiling, and beside the upper wall of z; the row at x is another solid's.
  const std::vector<sim::WallRow> rows = {row(0, 1, 1), row(0, 1, -1), row(0, 2, -1), row(1, 0, 1)};
  const Vec3d center(1.4, 2.9, 5.5);
  const solid::WallPlanes both = sim::walls_of(box, rows, 0, 6u, center);
  CHECK(both.axes == 6u);
  CHECK(both.opposite == 2u);
  CHECK(both.anchor[0] == center[0]);
  CHECK(both.anchor[2] == Approx(6.0));
  const solid::WallPlanes one = sim::walls_of(box, rows, 1, 1u, center);
  CHECK(one.axes == 1u);
  CHECK(one.opposite == 0u);
  CHECK(one.anchor == Vec3d(1.0, center[1], center[2]));
  // Held across an axis by something without rows: nothing moves there.
  CHECK(sim::walls_of(box, rows, 1, 3u, center).opposite == 2u);
}
