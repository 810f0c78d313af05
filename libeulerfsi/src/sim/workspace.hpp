// Purpose: what does not survive a step; never read across steps.
#pragma once

#include <vector>

#include "fluid/advect.hpp"
#include "sim/state.hpp"
#include "solid/displacement.hpp"
#include "solid/momentum.hpp"
#include "system/pressure_solve.hpp"
#include "system/slip.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

struct Workspace {
  CommonGrid common;                  // of the stages that join solids and fluid; nodes and cells below are its
  grid::VectorField velocity;         // the velocity of Eq. 11 at the nodes, at slip nodes the fluid's [m/s]
  system::SlipNodes slip;             // nodes where the fluid slips along a solid
  std::vector<std::uint8_t> fixed;    // per node: bit a: component a is fixed by a wall
  std::vector<Real> mass;             // all matter per node [kg]
  std::vector<Real> specific_volume;  // 1/density per node [m^3/kg]
  std::vector<std::uint8_t> owned;    // padded cells that carry a solid's stiffness; empty without solids
  std::vector<Real> cell_fraction;    // part of each cell that solids fill; empty without solids
  std::vector<Real> source;           // wanted divergence per padded cell [1/s]; empty: none
  std::vector<solid::SolidWork> solids;
  system::VelocitySystem velocity_system;
  system::PressureSystem pressure_system;
  std::vector<Real> f_star, v_star;  // Eq. 8 on the unknowns
  std::vector<Real> momentum;        // M v + dt f on the unknowns [kg m/s]
  std::vector<Real> correction;      // G^-1 J^T q of Eq. 13 on the unknowns [m/s]
  std::vector<Real> taken;           // q that acts on the velocity before the projection, padded cells [Pa s];
  bool takes = false;                // if this
  fluid::AdvectWorkspace advect;
  solid::AdvectWorkspace solid_advect;
  std::vector<solid::Momenta> first_momenta;  // of the solids, at the start of the step
  std::vector<solid::Momenta> solid_momenta;  // the same before the transport
  Vec3d fluid_momentum = Vec3d::Zero();
  State backup;                // the last good state
  bool masses_ready = false;   // the masses are those of the state
  bool uniform_ready = false;  // mass and pressure system of a scene without solids are built
};

}  // namespace efsi::sim
