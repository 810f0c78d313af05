// Purpose: every tunable of a simulation; the presets.
// Symbols: h voxel size, g gravity. The table of user parameters is libeulerfsi/parameters.toml.
#pragma once

#include <cstdint>

#include "fluid/fluid.hpp"
#include "grid/boundary.hpp"
#include "solid/map/displacement.hpp"
#include "system/pressure_solve.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// Values equal EFSI_PRESET_*.
enum class Preset : std::int32_t { kProduction = 0, kPaper2016 = 1, kFast = 2 };

// Which pieces a preset chooses. Each can be set alone.
struct Numerics {
  system::VelocitySolver velocity_solver = system::VelocitySolver::kPcg;
  system::PressureSolver pressure_solver = system::PressureSolver::kMultigridPcg;
  double velocity_tolerance = 0.01;
  double pressure_tolerance = 0.018;
  int points_per_element = 1;
  solid::AdvectionScheme solid_advection = solid::AdvectionScheme::kMacCormack;
  // With kPaper: distance below which the particles of a solid are repelled [cells], h of Eq. 14.
  double contact_distance = 1.0;
  bool corrected_fluid_advection = true;  // MacCormack; smoke and heat keep their amount
  bool carries_pressure = true;           // half of the pressure acts on the fluid before its transport, half after it
  // true: v = v* - G^-1 J^T q on solid nodes (Eq. 13 as printed); false: v = v* - M^-1 J^T q, divergence-free.
  bool stiff_correction = false;
  // Coupling steps, in which elasticity responds to the pressure, before the projection.
  bool coupling_step = true;
  // How much of the stiffness is implicit follows what a step does to the solid; false: all of it (Eq. 8).
  bool damping_by_pace = true;
  bool stiffness_by_part = true;   // a cell that is solid in part is as stiff; false: as a whole one
  bool resolve_impacts = true;     // steps of solids in contact follow what they lose
  double step_tolerance = 0.15;    // part of a solid's energy that these may take while a wave passes it
  double contact_travel = 0.4;     // cells that the surface of a solid in contact approaches another in a step
  bool repair_map = true;          // broken cells are repaired
  bool volume_by_pressure = true;  // alone: an incompressible solid's lambda is bounded
  bool unilateral_walls = true;    // solids leave them freely, and slide; false: they fix what they fix of the fluid
  bool volume_source = true;       // b of Eq. 11 restores det F = 1
  bool fluid_slips = true;         // beside a solid the fluid has a velocity of its own
  bool conserve_momentum = true;   // transport keeps linear and angular momentum
  // Particles carry the velocity of solids and repel each other.
  bool uses_particles() const { return solid_advection == solid::AdvectionScheme::kPaper; }
};

struct Params {
  Vec3d domain_min = Vec3d::Zero();
  Vec3d domain_size = Vec3d::Ones();
  double voxel_size = 0.02;
  Vec3d gravity = Vec3d::Zero();
  grid::Walls walls;
  fluid::FluidParams fluid;
  double cfl_solid = 1.8;
  double cfl_fluid = 5.0;
  double max_time_step = 0.0;
  int threads = 0;
  std::uint64_t memory_limit = 0;
  bool energy_ledger = false;  // measures what each stage does to the energy; changes no result
  Numerics numerics;
};

Numerics numerics_of(Preset preset);
// Throws Error(kArgument) that names the field, its value and the limit.
void validate(const Params& params);
grid::Grid make_grid(const Params& params);
// Bytes of a simulation on this grid; solid_volume: of the solids' boxes [m^3]. Without fluid for solids close
// together: apart, up to what it is with fluid.
double estimate_memory(const Params& params, double solid_volume);

}  // namespace efsi::sim
