#include "sim/slip_nodes.hpp"

#include <algorithm>

#include "sim/grid_loops.hpp"

namespace efsi::sim {

using grid::Grid;

system::SlipNodes find_slip_nodes(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                                  const SolidWorks& solids, const Matter& matter) {
  if (!scene.params.numerics.fluid_slips || !scene.params.fluid.present || scene.solids.empty()) return {};
  const Grid& g = matter.common.grid;
  std::vector<std::uint8_t> carriers(g.node_count(), 0);
  std::vector<std::uint32_t> first(g.node_count(), 0);  // solid that carries the node, and 1
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      if (!solids[l].carries[local]) return;
      ++carriers[g.node(i, j, k)];
      first[g.node(i, j, k)] = static_cast<std::uint32_t>(l + 1);
    });
  // Between folds of one solid; two solids part and meet, and the fluid between them has to get in and out.
  const auto is_gap = [&](int i, int j, int k) {
    const std::uint32_t solid = first[g.node(i, j, k)];
    return std::all_of(std::begin(grid::kCorner), std::end(grid::kCorner), [&](const auto& c) {
      const std::uint32_t corner = first[g.node(i + c[0], j + c[1], k + c[2])];
      return corner > 0 && corner == solid;
    });
  };
  std::vector<std::vector<system::SlipNode>> planes(static_cast<std::size_t>(g.cells[2] + 1));
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      const bool face = i == 0 || j == 0 || k == 0 || i == g.cells[0] || j == g.cells[1] || k == g.cells[2];
      const Real solid_mass = solids[l].mass[local], fluid_mass = matter.fluid_mass[n];
      if (face || carriers[n] != 1 || !solids[l].carries[local] || !(solid_mass > 0) || !(fluid_mass > 0)) return;
      system::SlipNode node{n, i, j, k, l, 0, Vec3::Zero(), solid_mass, fluid_mass};
      for (std::size_t a = 0; a < 8; ++a) {
        const auto& corner = grid::kCorner[a];
        if (!matter.owned[g.padded(i - corner[0], j - corner[1], k - corner[2])]) {
          if (is_gap(i - corner[0], j - corner[1], k - corner[2])) return;
          continue;
        }
        node.solid_cells = static_cast<std::uint8_t>(node.solid_cells | (1u << a));
      }
      node.normal = system::stair_normal(node.solid_cells);
      if (!node.normal.isZero()) planes[static_cast<std::size_t>(k)].push_back(node);
    });
  std::vector<system::SlipNode> nodes;
  for (const auto& plane : planes) nodes.insert(nodes.end(), plane.begin(), plane.end());
  return system::SlipNodes(parallel, g, std::move(nodes));
}

}  // namespace efsi::sim
