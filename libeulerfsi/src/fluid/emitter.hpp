// Purpose: emitters: regions that emit smoke and may prescribe the fluid's velocity, with values that change in time.
// Docs: docs/numerics/jets.md.
#pragma once

#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "fluid/fluid.hpp"
#include "geometry/mesh_sdf.hpp"

namespace efsi::fluid {

// What an emitter gives at a time: linear between two keys, and a jump where two have the same time; `on` lasts until
// the next key.
struct EmitterKey {
  double time = 0.0;         // [s]
  double density = 1.0;      // of smoke
  double temperature = 0.0;  // above ambient [K]
  Vec3d velocity = Vec3d::Zero();
  bool on = true;
};

// The mean of that over the part of a step in which the emitter is on; share: that part, 0: it is off.
struct Emission {
  double share = 0.0;
  double density = 0.0, temperature = 0.0;
  Vec3d velocity = Vec3d::Zero();
};

// Part of what is around each node that a region fills, 0..1: of a cube of a cell, on a block of nodes that may reach
// beyond the grid.
struct NodeCover {
  Vec3i low{0, 0, 0}, size{0, 0, 0};
  std::vector<Real> part;           // x fastest; empty: the emitter has no velocity
  std::vector<Real> inner;          // the same of what of the cube lies in the box
  std::vector<std::uint8_t> holds;  // 1: the node itself lies in the region

  bool within(const Vec3i& at) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (at[a] < low[a] || at[a] >= low[a] + size[a]) return false;
    return true;
  }
  std::size_t index(const Vec3i& at) const {
    const auto n = [&](std::size_t a) { return static_cast<std::size_t>(at[a] - low[a]); };
    return n(0) + static_cast<std::size_t>(size[0]) * (n(1) + static_cast<std::size_t>(size[1]) * n(2));
  }
};

struct Emitter : Region {
  enum class Mode : std::int32_t { kInitial = 0, kContinuous = 1 };
  Mode mode = Mode::kInitial;
  double density = 1.0;
  double temperature = 0.0;
  Vec3d velocity = Vec3d::Zero();
  bool has_velocity = false;
  double start_time = 0.0, end_time = 0.0;
  std::vector<EmitterKey> keys;  // in the order of their times; empty: the values above

  // Where it is, made once by place_emitter().
  std::vector<std::size_t> cells;  // whose middles lie in it
  NodeCover cover;
  std::vector<Vec3d> faces;  // normals times areas of a mesh's triangles [m^2]; empty: a box or a ball

  bool is_jet() const { return has_velocity && mode == Mode::kContinuous; }
  Emission emission(double time, double dt) const;
  bool gives_smoke() const;
  bool gives_heat() const;
  // Largest component of its velocity between two times [m/s]; 0 where it has none.
  double fastest(double from, double to) const;
  std::size_t bytes() const;
  // Area of the region's faces that look along a direction, across it [m^2]; direction: a unit vector.
  double area_across(const Vec3d& direction) const;
};

// Finds the cells and nodes of an emitter. volume: its region, in the place of box or ball; NULL: these. Throws
// Error(kArgument) where the region holds no middle of a cell of the grid, or where an emitter with a velocity holds no
// node.
void place_emitter(const Grid& g, const geometry::Surface* volume, Emitter& emitter);

// Smoke, heat and velocity of the emitters that are on in [time, time + dt). Cells that are more than half solid
// (cell_fraction) and nodes that are not the fluid's alone (specific_volume) are left as they are; both are empty where
// there are no solids. Initial emitters act when time is 0. velocity NULL: smoke and heat only.
void apply_emitters(const Grid& g, const std::vector<Emitter>& emitters, double time, double dt,
                    const std::vector<Real>& cell_fraction, const std::vector<Real>& specific_volume, Real fluid_volume,
                    FluidState& state, VectorField* velocity);

// A cell into which an emitter brings fluid.
struct SourceCell {
  Vec3i place{0, 0, 0};
  Real rate = 0;                    // volume per time and volume of the cell [1/s]
  Real smoke = 0, temperature = 0;  // of that fluid
};

// What a jet brings in with this emission: where the velocities that it gives, and 0 elsewhere, at walls and in solids,
// draw the fluid apart. In all it is the flux through the region, or less where solids cover it. Adds to `sources`;
// returns the flux [m^3/s]. fixed: per node, components that walls fix; owned: padded cells of solids, or empty.
double find_sources(const Grid& g, const Emitter& emitter, const Emission& emission,
                    const std::vector<std::uint8_t>& fixed, const std::vector<std::uint8_t>& owned,
                    const std::vector<Real>& specific_volume, Real fluid_volume, std::vector<SourceCell>& sources);

}  // namespace efsi::fluid
