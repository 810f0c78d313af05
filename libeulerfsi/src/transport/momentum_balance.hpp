// Purpose: what the transport of solids and fluid has to keep of momentum, measured before it and restored after it.
// Departs from the paper, which does neither (docs/deviations.md).
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solid/momentum.hpp"

namespace efsi::sim {

// What the transport has to keep.
struct TransportMomenta {
  std::vector<solid::Momenta> first;   // of the solids, at the start of the step
  std::vector<solid::Momenta> solids;  // the same before the transport
  Vec3d fluid = Vec3d::Zero();         // the fluid's before the transport [kg m/s]
};

// The solids' at the start of the step, of the state's velocities: momenta.first.
void measure_first_momenta(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                           TransportMomenta& momenta);
// Before the transport, lines 19 to 22: momenta.solids and momenta.fluid. The fluid's is kept along periodic axes of a
// box without open faces.
void measure_momenta(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     NodeVelocity& velocity, TransportMomenta& momenta);
// After it, of the masses that are then.
void restore_momenta(const StepContext& step, const TransportMomenta& momenta, const SolidWorks& solids,
                     const Matter& matter, SolidStates& states, grid::VectorField& fluid_velocity);

}  // namespace efsi::sim
