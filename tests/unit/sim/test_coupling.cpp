// Purpose: where the fluid slips along a solid.
#include "sim/coupling.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const material::Elastic kRubber{material::Law::kCorotational, 1e4, 5e3};

// A block of 9 x 6 x 6 cells with a slot of `slot` cells across x (none below 0), on the floor of a box or `floor`
// cells above it.
struct SlottedBlock {
  sim::Params params = box_params({0.4, 0.3, 0.3});
  grid::Grid g;
  std::vector<solid::SolidRest> rest;
  std::vector<fluid::Emitter> emitters;
  sim::State state;
  sim::Workspace work;

  SlottedBlock(double slot, int floor) {
    params.voxel_size = 0.02;
    g = sim::make_grid(params);
    const double h = g.h;
    const Vec3d middle(10 * h + h / 2, (floor + 3) * h, 7 * h), half(4.5 * h, 3 * h, 3 * h);
    const auto distance = [&](const Vec3d& x) {
      const Vec3d beyond = (x - middle).cwiseAbs() - half;
      return std::max(beyond.maxCoeff(), 0.5 * slot * h - std::abs(x[0] - middle[0]));
    };
    TestSolid block = make_solid(g, kRubber,
                                 sample_distance(middle - half - Vec3d::Constant(4 * h),
                                                 middle + half + Vec3d::Constant(4 * h), h / 8, distance));
    rest.push_back(block.rest);
    state.solids.push_back(block.state);
    work.solids.resize(1);
    sim::Profile profile;
    sim::compute_masses(Parallel(2), {params, g, rest, emitters}, state, work, profile);
  }

  std::size_t slipping(int lowest_x, int highest_x) const {
    std::size_t count = 0;
    for (const system::SlipNode& n : work.slip.nodes()) count += n.i >= lowest_x && n.i <= highest_x;
    return count;
  }
};

}  // namespace

TEST_CASE("The fluid slips at the surface of a solid, with normals that point out of it") {
  const SlottedBlock block(-9.0, 4);
  CHECK(block.work.slip.nodes().size() == 10 * 7 * 7 - 8 * 5 * 5);
  for (const system::SlipNode& n : block.work.slip.nodes()) {
    const Vec3d outwards = Vec3d(n.i, n.j, n.k) - Vec3d(10.5, 7, 7);
    CHECK(n.normal.norm() == Approx(1.0));
    CHECK(n.normal.cast<double>().dot(outwards) > 0.0);
    CHECK(n.solid_mass > 0);
    CHECK(n.fluid_mass > 0);
  }
}

TEST_CASE("At walls, in gaps of less than a cell and with the paper's preset solid and fluid have one velocity") {
  const SlottedBlock on_the_floor(-9.0, 0);
  for (const system::SlipNode& n : on_the_floor.work.slip.nodes()) CHECK(n.j > 0);
  CHECK_FALSE(on_the_floor.work.slip.empty());

  const SlottedBlock gap(0.8, 4), slot(3.0, 4);
  REQUIRE(gap.work.cell_fraction[gap.g.cell(10, 7, 7)] < solid::kElementFraction);
  CHECK(gap.slipping(10, 11) == 0);
  CHECK(gap.slipping(6, 9) > 0);
  CHECK(slot.slipping(9, 12) > 0);
}
