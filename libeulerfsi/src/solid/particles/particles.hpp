// Purpose: particles that carry a solid's velocity through its transport: grid, particles, moved, grid.
// Paper: Alg. 1 lines 13 (velocity), 18 (rasterisation); Sec. 4.6: 8 to 16 per cell, instantiated in every step. They
// are no state: nothing of them is there when a step begins. FLIP gives a particle
//   v_p = a (v_p^n + v^{n+1}(x_p) - v^n(x_p)) + (1 - a) v^{n+1}(x_p),
// and one made in this step has no other v_p^n than v^n(x_p): for any ratio a, v_p = v^{n+1}(x_p).
//   grid to particles  v_p = sum_i w_ip v_i / sum_i w_ip over the nodes with data
//   particles to grid  v_i = sum_p w_ip m_p v_p / sum_p w_ip m_p after x_p += dt v_p
// w: the tent of a cell's width (Zhu and Bridson 2005). A constant velocity is kept, angular momentum is damped
// (docs/numerics/particles.md).
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

inline constexpr int kParticlesPerCell = 8;  // one in each eighth of a cell

struct Particles {
  std::vector<Vec3d> x;    // [m]
  std::vector<Vec3> v;     // [m/s]
  std::vector<Real> mass;  // [kg]
  std::size_t size() const { return x.size(); }
  std::size_t bytes() const;
};

// Line 13: particles in all cells that hold solid, with the velocity of the grid where work.layer has data. One per
// eighth of a cell at a place that a hash of seed and cell chooses; those outside the rest shape are left out.
void seed_particles(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const SolidWork& work,
                    std::uint64_t seed, Particles& particles);

// The solid's velocity at x; false where no node around it has data.
bool velocity_at(const SolidState& state, const std::vector<std::uint8_t>& layer, const Vec3d& x, Vec3& v);

// Line 18: moves the particles and gives the band their velocity, with the extension beyond. work.layer stays 255 where
// u has no data.
void rasterize(const Parallel& parallel, double dt, const SolidRest& rest, Particles& particles, SolidState& state,
               SolidWork& work);

}  // namespace efsi::solid
