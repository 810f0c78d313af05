// Purpose: the six faces of the box: which velocity components are fixed, ghost pressures.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "grid/grid.hpp"

namespace efsi::grid {

// Values equal EFSI_WALL_* of the C API.
enum class Wall : std::int32_t { kSlip = 0, kNoSlip = 1, kOpen = 2, kPeriodic = 3 };

struct Walls {
  // -x +x -y +y -z +z
  std::array<Wall, 6> face{Wall::kSlip, Wall::kSlip, Wall::kSlip, Wall::kSlip, Wall::kSlip, Wall::kSlip};

  // How each face moves: along itself where the fluid sticks to it, across itself where fluid comes in or goes out
  // through it [m/s].
  std::array<Vec3d, 6> velocity{Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero(),
                                Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};

  Wall lower(int axis) const { return face[static_cast<std::size_t>(2 * axis)]; }
  Wall upper(int axis) const { return face[static_cast<std::size_t>(2 * axis + 1)]; }
  bool any_open() const {
    for (Wall wall : face)
      if (wall == Wall::kOpen) return true;
    return false;
  }
  bool any_moves() const {
    for (const Vec3d& v : velocity)
      if (!v.isZero(0)) return true;
    return false;
  }
  static bool blocks(Wall wall) { return wall == Wall::kSlip || wall == Wall::kNoSlip; }
};

// Along which axis a box is one cell thick between slip walls, so that nothing in it moves or changes along that axis
// (docs/numerics/slabs.md); -1: none.
inline int slab_axis(const Grid& g, const Walls& walls) {
  for (const int a : {2, 1, 0})
    if (g.cells[static_cast<std::size_t>(a)] == 1 && walls.lower(a) == Wall::kSlip && walls.upper(a) == Wall::kSlip)
      return a;
  return -1;
}

// Bit a of the result: component a of the velocity at node (i,j,k) is fixed by a wall.
inline unsigned fixed_components(const Grid& g, const Walls& walls, int i, int j, int k) {
  const int index[3] = {i, j, k};
  unsigned fixed = 0;
  for (int a = 0; a < 3; ++a) {
    const int n = g.cells[static_cast<std::size_t>(a)];
    if (index[a] != 0 && index[a] != n) continue;
    const Wall wall = index[a] == 0 ? walls.lower(a) : walls.upper(a);
    if (wall == Wall::kSlip) fixed |= 1u << a;
    if (wall == Wall::kNoSlip) fixed |= 7u;
  }
  return fixed;
}

// To what walls fix the components at a node. Across itself each wall decides; along itself, where several meet, the
// slowest.
inline Vec3 wall_velocity(const Grid& g, const Walls& walls, int i, int j, int k) {
  const int index[3] = {i, j, k};
  Vec3d across = Vec3d::Zero(), along = Vec3d::Constant(std::numeric_limits<double>::infinity());
  bool decided[3] = {false, false, false};
  for (std::size_t a = 0; a < 3; ++a) {
    const int n = g.cells[a];
    if (index[a] != 0 && index[a] != n) continue;
    const std::size_t face = 2 * a + (index[a] == 0 ? 0 : 1);
    if (!Walls::blocks(walls.face[face])) continue;
    decided[a] = true;
    across[static_cast<Eigen::Index>(a)] = walls.velocity[face][static_cast<Eigen::Index>(a)];
    if (walls.face[face] != Wall::kNoSlip) continue;
    for (Eigen::Index b = 0; b < 3; ++b)
      if (std::abs(walls.velocity[face][b]) < std::abs(along[b])) along[b] = walls.velocity[face][b];
  }
  Vec3 v = Vec3::Zero();
  for (Eigen::Index b = 0; b < 3; ++b)
    v[b] = static_cast<Real>(decided[b] ? across[b] : std::isfinite(along[b]) ? along[b] : 0.0);
  return v;
}

// The same for every node. Solids slide on walls: nodes that carry a solid keep their tangential components free on a
// no-slip wall, which constrains the fluid only (friction belongs to contact).
inline std::uint8_t fixed_for_solid(const Grid& g, Walls walls, int i, int j, int k) {
  for (Wall& wall : walls.face)
    if (wall == Wall::kNoSlip) wall = Wall::kSlip;
  return static_cast<std::uint8_t>(fixed_components(g, walls, i, j, k));
}

inline std::vector<std::uint8_t> fixed_by_walls(const Grid& g, const Walls& walls) {
  std::vector<std::uint8_t> fixed(g.node_count(), 0);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j) {
      const bool face = k == 0 || j == 0 || k == g.cells[2] || j == g.cells[1];
      for (int i = 0; i <= g.cells[0]; i += face ? 1 : g.cells[0])
        fixed[g.node(i, j, k)] = static_cast<std::uint8_t>(fixed_components(g, walls, i, j, k));
    }
  return fixed;
}

// Fills the ghost layer of a padded cell array: opposite cells on periodic axes, `outside` elsewhere.
template <class T>
void fill_ghosts(const Grid& g, std::vector<T>& field, T outside) {
  const int n[3] = {g.cells[0], g.cells[1], g.cells[2]};
  // x, then y, then z, so that edges and corners of periodic axes are right.
  for (int k = -1; k <= n[2]; ++k)
    for (int j = -1; j <= n[1]; ++j) {
      field[g.padded(-1, j, k)] = g.periodic[0] ? field[g.padded(n[0] - 1, j, k)] : outside;
      field[g.padded(n[0], j, k)] = g.periodic[0] ? field[g.padded(0, j, k)] : outside;
    }
  for (int k = -1; k <= n[2]; ++k)
    for (int i = -1; i <= n[0]; ++i) {
      field[g.padded(i, -1, k)] = g.periodic[1] ? field[g.padded(i, n[1] - 1, k)] : outside;
      field[g.padded(i, n[1], k)] = g.periodic[1] ? field[g.padded(i, 0, k)] : outside;
    }
  for (int j = -1; j <= n[1]; ++j)
    for (int i = -1; i <= n[0]; ++i) {
      field[g.padded(i, j, -1)] = g.periodic[2] ? field[g.padded(i, j, n[2] - 1)] : outside;
      field[g.padded(i, j, n[2])] = g.periodic[2] ? field[g.padded(i, j, 0)] : outside;
    }
}

// Calls body(node, its copy) for the nodes on the lower face of a periodic axis.
template <class Body>
void for_copies(const Grid& g, std::size_t axis, const Body& body) {
  if (!g.periodic[axis]) return;
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const std::size_t far = g.node_stride(static_cast<int>(axis)) * static_cast<std::size_t>(g.cells[axis]);
  const std::size_t along_u = g.node_stride(static_cast<int>(u)), along_v = g.node_stride(static_cast<int>(v));
  for (std::size_t q = 0; q <= static_cast<std::size_t>(g.cells[v]); ++q)
    for (std::size_t p = 0; p <= static_cast<std::size_t>(g.cells[u]); ++p) {
      const std::size_t node = p * along_u + q * along_v;
      body(node, node + far);
    }
}

// Copies take the values of their originals; x, then y, then z, so that those of edges and corners are right.
inline void fill_copies(const Grid& g, VectorField& field) {
  for (std::size_t a = 0; a < 3; ++a)
    for_copies(g, a, [&](std::size_t node, std::size_t copy) {
      for (auto& c : field.c) c[copy] = c[node];
    });
}

// Makes the ghost layer of a padded cell array zero.
template <class T>
void clear_ghosts(const Grid& g, std::vector<T>& field) {
  auto from = field.begin();  // the first ghost that is not cleared yet
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j) {
      const auto cells = field.begin() + static_cast<std::ptrdiff_t>(g.padded(0, j, k));
      std::fill(from, cells, T(0));
      from = cells + g.cells[0];
    }
  std::fill(from, field.end(), T(0));
}
// The same for a field whose ghosts are zero already: nothing to do unless an axis is periodic.
template <class T>
void fill_periodic_ghosts(const Grid& g, std::vector<T>& field) {
  if (g.periodic[0] || g.periodic[1] || g.periodic[2]) fill_ghosts(g, field, T(0));
}

}  // namespace efsi::grid
