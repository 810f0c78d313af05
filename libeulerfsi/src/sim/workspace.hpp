// Purpose: what does not survive a step, in parts that the rooms own; a stage gets the parts that it names.
#pragma once

#include <vector>

#include "fluid/advect.hpp"
#include "fluid/viscosity.hpp"
#include "frame/scene.hpp"
#include "frame/state.hpp"
#include "nodes/node_fields.hpp"
#include "solid/map/displacement.hpp"
#include "solid/particles/particles.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"
#include "transport/momentum_balance.hpp"

namespace efsi::sim {

struct Workspace {
  SolidWorks solids;
  Matter matter;
  NodeVelocity velocity;
  VelocityEquation elasticity;
  PressureEquation pressure;
  TransportMomenta momenta;
  fluid::AdvectWorkspace advect;
  solid::AdvectWorkspace solid_advect;
  NodeVelocity before_forces;               // at the nodes; empty unless the fluid is viscous
  fluid::ViscousWorkspace viscous;          // empty unless the fluid is viscous
  std::vector<solid::Particles> particles;  // per solid; empty where no preset asks for them
  State backup;                             // the last good state
  bool masses_ready = false;                // solids' masses and matter are those of the state

  // Another state: nothing derived from the last one is valid.
  void forget() { masses_ready = pressure.lasts = false; }
};

}  // namespace efsi::sim
