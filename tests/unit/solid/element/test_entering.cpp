// Purpose: new elements whose corners are extrapolated take the map of the elements beside them.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "solid/element/entering.hpp"
#include "solid/element/mass.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kFine = 0.02;  // size of the cells [m]
const Vec3d kCenter = Vec3d::Constant(0.24);

Vec3d stretched(const Vec3d& x) {
  Mat3d inverse;
  inverse << 0.8, 0.2, 0.0, 0.1, 1.2, -0.1, 0.0, 0.2, 1.0;
  return x - kCenter - inverse * (x - kCenter);
}

// A stretched ball of ten cells across, an element at its lower x that is new, and a corner of that one at its outside.
struct Entering {
  TestSolid s = make_ball(cube_grid(24, kFine), kSoft, kCenter, 0.1);
  std::size_t cell = 0, corner = 0;

  Entering() {
    s.rest.stiff_by_part = true;
    set_displacement(s, stretched);
    s.state.valid.assign(s.state.band.grid.node_count(), solid::kKnown);
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    solid::remember_elements(s.work, true, s.state);
    const grid::Grid& g = s.state.band.grid;
    Vec3i at{0, 12, 12};
    while (s.work.element[g.cell(at[0], at[1], at[2])] < 0) ++at[0];
    cell = g.cell(at[0], at[1], at[2]);
    corner = g.node(at[0], at[1], at[2]);
    s.state.stiff[cell] = 0;
    s.state.valid[corner] = solid::kEdge;
  }
  // Moves the map of the corner by that many cells along the surface.
  void move(double cells) {
    s.state.u.set(corner, s.state.u.at(corner) + Vec3(0, Real(cells * kFine), 0));
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  }
  bool settle(int threads = 1) { return solid::settle_entering(Parallel(threads), s.rest, s.state, s.work); }
  // By which u at a node differs from that of the ball elsewhere, in cells.
  double off(std::size_t node) const {
    const auto [i, j, k] = s.state.band.grid.node_place(node);
    const Vec3d x = s.state.band.grid.node_position(i, j, k);
    return (s.state.u.at(node).cast<double>() - stretched(x)).norm() / kFine;
  }
};

}  // namespace

TEST_CASE("A new element far from the strain of those beside it takes their map where its own is extrapolated",
          "[law]") {
  for (const double cells : {-2.5, 2.5}) {
    Entering e;
    const auto before = e.s.work.mass;
    e.move(cells);
    REQUIRE(e.s.work.element[e.cell] >= 0);
    REQUIRE(e.off(e.corner) > 2.4);
    CHECK(e.settle(2));
    for (std::size_t n = 0; n < e.s.state.band.grid.node_count(); ++n) CHECK(e.off(n) < 1e-4);
    for (std::size_t n = 0; n < before.size(); ++n)
      CHECK(std::abs(e.s.work.mass[n] - before[n]) <= Real(1e-4) * e.s.work.mass[n] + Real(1e-9));
  }
}

TEST_CASE("What was an element before, is known or agrees with those beside it keeps its map") {
  Entering near;
  near.move(0.3);
  CHECK_FALSE(near.settle());
  Entering known;
  known.s.state.valid[known.corner] = solid::kKnown;
  known.move(2.5);
  CHECK_FALSE(known.settle());
  Entering before;
  before.s.state.stiff[before.cell] = solid::kCarried;
  before.move(2.5);
  CHECK_FALSE(before.settle());
  CHECK(before.off(before.corner) > 2.4);
  Entering whole;
  whole.s.rest.stiff_by_part = false;
  whole.move(2.5);
  CHECK_FALSE(whole.settle());
  Entering first;
  first.s.state.stiff.clear();
  first.move(2.5);
  CHECK_FALSE(first.settle());
}
