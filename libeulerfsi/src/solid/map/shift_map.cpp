#include "solid/map/shift_map.hpp"

namespace efsi::solid {
namespace {

// du/dx_a at a node that holds data, of its neighbours along the axis that do; 0 where there is none.
Vec3 derivative(const SolidState& state, const Vec3i& at, std::size_t n, std::size_t a) {
  const Grid& g = state.band.grid;
  const std::size_t stride = g.node_stride(static_cast<int>(a));
  const bool below = at[a] > 0 && state.valid[n - stride] != kNoData;
  const bool above = at[a] < g.cells[a] && state.valid[n + stride] != kNoData;
  if (!below && !above) return Vec3::Zero();
  const Vec3 change = state.u.at(above ? n + stride : n) - state.u.at(below ? n - stride : n);
  return change / static_cast<Real>(g.h * (below && above ? 2.0 : 1.0));
}

}  // namespace

void shift_map(const Parallel& parallel, const Vec3d& offset, SolidState& state) {
  const Grid& g = state.band.grid;
  const Vec3 d = offset.cast<Real>();
  grid::VectorField moved = state.u;
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (state.valid[n] == kNoData) continue;
        Vec3 u = state.u.at(n) + d;
        for (std::size_t a = 0; a < 3; ++a) u -= d[static_cast<Eigen::Index>(a)] * derivative(state, {i, j, k}, n, a);
        moved.set(n, u);
      }
  });
  state.u = std::move(moved);
  for (Vec3d& x : state.surface) x += offset;
}

}  // namespace efsi::solid
