// Purpose: a solid moved by a part of a cell is the same solid.
#include <catch2/catch.hpp>

#include "solid/map/shift_map.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

TEST_CASE("A shifted map is that of the solid moved as it is, stretched and turned") {
  sim::Params p = box_params({0.4, 0.4, 0.4});
  p.fluid.present = false;
  auto s = make_simulation(p, {ball_desc({0.2, 0.2, 0.2})});
  solid::SolidState state = s->state().solids[0];
  const grid::Grid& g = state.band.grid;
  Mat3d f;
  f << 1.1, 0.2, 0.0, -0.1, 0.9, 0.05, 0.0, 0.1, 1.05;
  const Mat3d inverse = f.inverse();
  const Vec3d middle(0.2, 0.2, 0.2), offset(0.0003, -0.0002, 0.0001);
  const auto displacement = [&](const Vec3d& x) { return Vec3d(x - middle - inverse * (x - middle)); };
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        state.u.set(g.node(i, j, k), displacement(g.node_position(i, j, k)).cast<Real>());
  const std::vector<Vec3d> surface = state.surface;
  solid::shift_map(Parallel(2), offset, state);
  double worst = 0.0;
  int nodes = 0;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (state.valid[n] == solid::kNoData) continue;
        ++nodes;
        const Vec3d exact = displacement(g.node_position(i, j, k) - offset) + offset;
        worst = std::max(worst, (state.u.at(n).cast<double>() - exact).norm());
      }
  CHECK(nodes > 100);
  CHECK(worst < 1e-7);  // m, of 4e-4: rounding
  for (std::size_t v = 0; v < surface.size(); ++v) CHECK((state.surface[v] - surface[v] - offset).norm() < 1e-15);
}
