#include "nodes/slip_nodes.hpp"

#include <algorithm>
#include <optional>

#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"

namespace efsi::sim {
namespace {

using grid::Grid;
using system::SlipNode;

constexpr std::uint32_t kShared = 0xffffffff;  // carrier of a node that several solids carry

// Which solid carries each node, and 1; kShared.
std::vector<std::uint32_t> find_carriers(const Parallel& parallel, const Grid& g, const SolidStates& states,
                                         const SolidWorks& solids) {
  std::vector<std::uint32_t> carrier(g.node_count(), 0);
  for (std::size_t l = 0; l < states.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      std::uint32_t& at = carrier[g.node(i, j, k)];
      if (solids[l].carries[local]) at = at == 0 ? static_cast<std::uint32_t>(l + 1) : kShared;
    });
  return carrier;
}

// The node of solid l's band there, if it carries it.
std::optional<std::size_t> carried(const Grid& g, const SolidStates& states, const SolidWorks& solids, std::size_t l,
                                   const Vec3i& at) {
  const Grid& band = states[l].band.grid;
  const Vec3i lo = grid::offset(band, g);
  for (std::size_t a = 0; a < 3; ++a)
    if (at[a] < lo[a] || at[a] > lo[a] + band.cells[a]) return {};
  const std::size_t local = band.node(at[0] - lo[0], at[1] - lo[1], at[2] - lo[2]);
  if (!solids[l].carries[local]) return {};
  return local;
}

// A node that only one solid carries: its velocity and the fluid's, if the fluid slips there. At corners of slivers
// alone, of no cell that is a solid's, n = 0.
bool find_slip(const Matter& matter, const std::vector<std::uint32_t>& carrier, std::size_t solid, Real solid_mass,
               const Vec3i& at, SlipNode& node) {
  const Grid& g = matter.common.grid;
  const auto [i, j, k] = at;
  const Real fluid_mass = matter.fluid_mass[node.node];
  const int slab = grid::slab_axis(g, matter.common.walls);
  bool face = false;
  for (std::size_t a = 0; a < 3; ++a)
    face = face || (static_cast<int>(a) != slab && (at[a] == 0 || at[a] == g.cells[a]));
  if (face || !(solid_mass > 0) || !(fluid_mass > 0)) return false;
  // Between folds of one solid; two solids part and meet, and the fluid between them has to get in and out.
  const auto is_gap = [&](int x, int y, int z) {
    const std::uint32_t first = carrier[g.node(x, y, z)];
    return first > 0 && first != kShared &&
           std::all_of(std::begin(grid::kCorner), std::end(grid::kCorner), [&](const auto& c) {
             return carrier[g.node(x + c[0], y + c[1], z + c[2])] == first &&
                    cells_owned_by(g, matter.owned, first, x + c[0], y + c[1], z + c[2]);
           });
  };
  for (std::size_t a = 0; a < 8; ++a) {
    const auto& corner = grid::kCorner[a];
    if (slab >= 0 && at[static_cast<std::size_t>(slab)] != corner[slab]) continue;  // beyond the slab
    if (matter.owned[g.padded(i - corner[0], j - corner[1], k - corner[2])])
      node.solid_cells = static_cast<std::uint8_t>(node.solid_cells | (1u << a));
    else if (is_gap(i - corner[0], j - corner[1], k - corner[2]))
      return false;
  }
  node.solid = solid;
  node.solid_mass = solid_mass;
  node.fluid_mass = fluid_mass;
  node.normal = system::stair_normal(node.solid_cells, slab);
  return node.solid_cells == 0 || !node.normal.isZero();
}

// A node that several solids carry: one entry for each of them.
void find_shared(const Scene& scene, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                 const Vec3i& at, const SlipNode& node, std::vector<SlipNode>& out) {
  const auto& [g, walls] = matter.common;
  const auto [i, j, k] = at;
  const std::size_t before = out.size();
  for (std::size_t l = 0; l < states.size(); ++l) {
    const auto local = carried(g, states, solids, l, at);
    if (!local) continue;
    SlipNode entry = node;
    entry.solid = l;
    entry.solid_cells = cells_owned_by(g, matter.owned, l + 1, i, j, k);
    entry.solid_mass = solids[l].mass[*local];
    entry.in_fluid = scene.params.fluid.present;
    if (entry.in_fluid) entry.fluid_cells = cells_owned_by(g, matter.owned, 0, i, j, k);
    entry.fluid_mass = matter.fluid_mass[node.node];
    entry.mass = matter.mass[node.node];
    entry.base_fixed = matter.fixed[node.node];
    entry.fixed = entry.held = grid::fixed_for_solid(g, walls, i, j, k);
    entry.fluid_fixed = static_cast<std::uint8_t>(grid::fixed_components(g, walls, i, j, k));
    out.push_back(entry);
  }
  for (std::size_t t = before; t < out.size(); ++t) out[t].solids = static_cast<std::uint8_t>(out.size() - before);
}

}  // namespace

system::SlipNodes find_slip_nodes(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                                  const SolidWorks& solids, const Matter& matter) {
  const Numerics& numerics = scene.params.numerics;
  const fluid::FluidParams& fluid = scene.params.fluid;
  const bool slips = numerics.fluid_slips && fluid.present && !fluid.is_viscous();  // what is viscous sticks
  const bool shares = numerics.unilateral_walls && states.size() > 1;
  if (states.empty() || (!slips && !shares)) return {};
  const Grid& g = matter.common.grid;
  const std::vector<std::uint32_t> carrier = find_carriers(parallel, g, states, solids);
  std::vector<std::vector<SlipNode>> planes(static_cast<std::size_t>(g.cells[2] + 1));
  for (std::size_t l = 0; l < states.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      SlipNode node{};
      node.node = g.node(i, j, k);
      node.i = i;
      node.j = j;
      node.k = k;
      std::vector<SlipNode>& plane = planes[static_cast<std::size_t>(k)];
      if (!solids[l].carries[local]) return;
      if (carrier[node.node] == kShared) {
        if (!shares) return;
        for (std::size_t earlier = 0; earlier < l; ++earlier)
          if (carried(g, states, solids, earlier, {i, j, k})) return;  // it has found them all
        find_shared(scene, states, solids, matter, {i, j, k}, node, plane);
      } else if (slips && find_slip(matter, carrier, l, solids[l].mass[local], {i, j, k}, node)) {
        plane.push_back(node);
      }
    });
  std::vector<SlipNode> nodes;
  for (auto& plane : planes) {
    if (states.size() > 1)
      std::sort(plane.begin(), plane.end(), [](const SlipNode& a, const SlipNode& b) {
        return std::pair(a.node, a.solid) < std::pair(b.node, b.solid);
      });
    nodes.insert(nodes.end(), plane.begin(), plane.end());
  }
  return system::SlipNodes(parallel, g, std::move(nodes), grid::slab_axis(g, matter.common.walls));
}

}  // namespace efsi::sim
