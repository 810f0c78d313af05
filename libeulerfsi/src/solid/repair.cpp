#include "solid/repair.hpp"

#include <algorithm>
#include <array>

#include "grid/extrapolate.hpp"
#include "solid/mass.hpp"

namespace efsi::solid {
namespace {

constexpr int kPasses = 3;
constexpr Real kInside = Real(1) - Real(1e-6);  // of a cell
constexpr double kMostCutGrowth = 9.99;         // of a cut cell; inverted ones count as grown tenfold (volume_ratio)

// Marks the nodes of broken cells; how many cells these are.
std::uint64_t mark_broken(const SolidState& state, double density, const SolidWork& work,
                          std::vector<std::uint8_t>& broken) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const double mean = density * work.volume / work.counted_mass;  // det F of the solid
  std::uint64_t count = 0;
  for (std::size_t e = 0; e < work.element_cell.size(); ++e) {
    const auto c = static_cast<std::size_t>(work.element_cell[e]);
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    const double det = static_cast<double>(work.volume_ratio[c]);
    const double growth = std::max(det / mean, mean / det);
    if (growth <= (work.fraction[c] < kInside ? kMostCutGrowth : kMostGrowth)) continue;
    ++count;
    for (const std::size_t offset : corner) broken[n + offset] = 1;
  }
  return count;
}

// The broken nodes take u from the others; false: there are none.
bool extend_over(const Parallel& parallel, const std::vector<std::uint8_t>& broken, SolidState& state,
                 const SolidWork& work) {
  std::vector<std::uint8_t> layer(broken.size(), grid::kNoLayer);
  bool any = false;
  for (std::size_t n = 0; n < layer.size(); ++n)
    if (work.carries[n] && !broken[n]) {
      layer[n] = 0;
      any = true;
    }
  if (!any) return false;
  VectorField u = state.u;
  const std::array<Real*, 3> fields = {u.c[0].data(), u.c[1].data(), u.c[2].data()};
  grid::extend_linear(parallel, state.band.grid, kExtensionLayers, layer, fields);
  for (std::size_t n = 0; n < layer.size(); ++n)
    if (broken[n] && layer[n] != grid::kNoLayer) state.u.set(n, u.at(n));
  return true;
}

}  // namespace

std::uint64_t repair_map(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work) {
  if (rest.compressible || work.element_cell.empty()) return 0;
  std::vector<std::uint8_t> broken(state.band.grid.node_count(), 0);
  std::uint64_t repaired = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const std::uint64_t cells = mark_broken(state, rest.density, work, broken);
    if (cells == 0 || !extend_over(parallel, broken, state, work)) break;
    repaired += cells;
    compute_mass(parallel, rest, state, work);
  }
  return repaired;
}

}  // namespace efsi::solid
