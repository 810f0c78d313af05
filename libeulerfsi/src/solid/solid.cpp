#include "solid/solid.hpp"

#include <algorithm>

namespace efsi::solid {

std::size_t SolidWork::bytes() const {
  const std::size_t reals = fraction.size() + volume_ratio.size() + hourglass.size() + mass.size();
  return reals * sizeof(Real) + (element.size() + element_cell.size() + element_corner.size()) * sizeof(std::int32_t) +
         point.size() * sizeof(ElementPoint) + carries.size() + layer.size();
}

std::size_t state_bytes(const SolidState& state) {
  return 6 * state.u.size() * sizeof(Real) + state.valid.size() + state.surface.size() * sizeof(Vec3d);
}

Band make_band(const Grid& global, Vec3i lo, Vec3i hi) {
  Band band;
  band.grid.h = global.h;
  for (std::size_t a = 0; a < 3; ++a) {
    lo[a] = std::clamp(lo[a] - kBandMargin, 0, global.cells[a] - 1);
    hi[a] = std::clamp(hi[a] + kBandMargin, lo[a] + 1, global.cells[a]);
    band.grid.cells[a] = hi[a] - lo[a];
  }
  band.lo = lo;
  band.grid.origin = global.node_position(lo[0], lo[1], lo[2]);
  return band;
}

void move_band(SolidState& state, const Band& band) {
  const std::size_t n = band.grid.node_count();
  VectorField u, v;
  u.assign(n);
  v.assign(n);
  std::vector<std::uint8_t> valid(n, 0);
  const Band& old = state.band;
  if (!state.valid.empty()) {
    int begin[3], end[3];
    for (std::size_t a = 0; a < 3; ++a) {
      begin[a] = std::max(band.lo[a], old.lo[a]);
      end[a] = std::min(band.lo[a] + band.grid.cells[a], old.lo[a] + old.grid.cells[a]);
    }
    for (int k = begin[2]; k <= end[2]; ++k)
      for (int j = begin[1]; j <= end[1]; ++j)
        for (int i = begin[0]; i <= end[0]; ++i) {
          const std::size_t from = old.grid.node(i - old.lo[0], j - old.lo[1], k - old.lo[2]);
          const std::size_t to = band.grid.node(i - band.lo[0], j - band.lo[1], k - band.lo[2]);
          u.set(to, state.u.at(from));
          v.set(to, state.v.at(from));
          valid[to] = state.valid[from];
        }
  }
  state.band = band;
  state.u = std::move(u);
  state.v = std::move(v);
  state.valid = std::move(valid);
}

}  // namespace efsi::solid
