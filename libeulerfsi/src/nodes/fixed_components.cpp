#include "nodes/fixed_components.hpp"

#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"

namespace efsi::sim {

using grid::Grid;

void find_fixed_components(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                           const SolidWorks& solids, Matter& matter) {
  const auto& [g, walls] = matter.common;
  matter.fixed.resize(g.node_count(), 0);
  for_face_nodes(parallel, g, [&](std::size_t n, int i, int j, int k) {
    matter.fixed[n] = static_cast<std::uint8_t>(grid::fixed_components(g, walls, i, j, k));
  });
  if (!scene.params.numerics.unilateral_walls) return;  // walls fix solids as they fix the fluid
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const Grid& band = states[l].band.grid;
    const Vec3i lo = grid::offset(band, g);
    for_face_nodes(parallel, band, [&](std::size_t local, int i, int j, int k) {
      if (!solids[l].carries[local]) return;
      const int gi = i + lo[0], gj = j + lo[1], gk = k + lo[2];
      const std::size_t n = g.node(gi, gj, gk);
      if (matter.fixed[n]) matter.fixed[n] = grid::fixed_for_solid(g, walls, gi, gj, gk);
    });
  }
}

// Walls fix nodes on the faces only.
void enforce_walls(const Parallel& parallel, const CommonGrid& common, const std::vector<std::uint8_t>& fixed,
                   grid::VectorField& velocity) {
  const bool moves = common.walls.any_moves();
  for_face_nodes(parallel, common.grid, [&](std::size_t n, int i, int j, int k) {
    const Vec3 wall = moves ? grid::wall_velocity(common.grid, common.walls, i, j, k) : Vec3(Vec3::Zero());
    for (std::size_t a = 0; a < 3; ++a)
      if (fixed[n] & (1u << a)) velocity.c[a][n] = wall[static_cast<Eigen::Index>(a)];
  });
}

}  // namespace efsi::sim
