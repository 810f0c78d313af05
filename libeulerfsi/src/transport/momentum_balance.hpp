// Purpose: what the transport of solids and fluid has to keep of momentum, measured before it and restored after it.
// Departs from the paper, which does neither (docs/deviations.md).
#pragma once

#include "contact/hold.hpp"
#include "contact/wall_friction.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solid/momentum.hpp"

namespace efsi::sim {

// What the transport has to keep.
struct TransportMomenta {
  std::vector<solid::Momenta> first;   // of the solids, at the start of the step
  std::vector<solid::Momenta> solids;  // the same before the transport
  Vec3d fluid = Vec3d::Zero();         // the fluid's before the transport [kg m/s]
  std::vector<Vec3d> centers;          // where those lead that touch each other in mid-air; empty: none does [m]
  std::vector<RigidImpulse> friction;  // on the solids, of which the velocities do not know yet; empty: none
};

// The solids' at the start of the step, of the state's velocities: momenta.first.
void measure_first_momenta(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                           TransportMomenta& momenta);
// Before the transport, lines 19 to 22: momenta.solids and momenta.fluid. The fluid's is kept along periodic axes of a
// box without open faces. Keeps what the step has accelerated each solid by.
void measure_momenta(const StepContext& step, SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     NodeVelocity& velocity, TransportMomenta& momenta);
// Where the centres of solids in floating clusters go: by their momenta after the impulses of contact, which act on all
// of them at one time and place. Fills momenta.centers, not a number where that is not asked for.
void find_centers(const StepContext& step, const Holds& holds, const std::vector<solid::BodyStep>& frames,
                  const SolidStates& states, TransportMomenta& momenta);
// After the transport: moves these there, and their masses along.
void restore_centers(const StepContext& step, const TransportMomenta& momenta, SolidStates& states, SolidWorks& solids);
// After it, of the masses that are then, and with momenta.friction.
void restore_momenta(const StepContext& step, const TransportMomenta& momenta, const SolidWorks& solids,
                     const Matter& matter, SolidStates& states, grid::VectorField& fluid_velocity);

}  // namespace efsi::sim
