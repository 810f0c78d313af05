// Purpose: what a step reports beside its counters: repairs, what the transport loses.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "sim/scene.hpp"
#include "solid/momentum.hpp"
#include "solid/repair.hpp"

namespace efsi::sim {

// Cells that a step changed because their map could not be, counted before anything acts, and det F of full cells
// before and after. Sums and extremes over the solids (EfsiRepairs).
struct Repairs {
  std::uint64_t clamped = 0;   // cells whose F was clamped in the forces
  std::uint64_t rejected = 0;  // cells whose map was rejected after the transport
  std::uint64_t broken = 0;    // of incompressible solids: det F out of bounds after the transport
  std::uint64_t put_back = 0;  // cells that the repair moved, with those that it broke itself
  double min_det_f_before = 1.0, max_det_f_before = 1.0, min_det_f_after = 1.0, max_det_f_after = 1.0;
};
// After the transport, and after the repair.
void inspect_before(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out);
void inspect_after(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out);

// What the transport of a step changes in a solid's volume and momenta before anything restores them
// (EfsiTransportChange).
struct TransportChange {
  double volume_mesh = 0.0, volume_cells = 0.0;  // less what the pressure gave, over the volume at rest; incompressible
  Vec3d momentum = Vec3d::Zero();                // [kg m/s]
  Vec3d angular_momentum = Vec3d::Zero();        // about the centre of mass [kg m^2/s]
  double mass = 0.0;                             // by cell fractions, relative to the first step's, minus 1
};
// Volumes that a transport without loss ends with, over those at rest.
struct VolumeTarget {
  double mesh = 1.0, cells = 1.0;
};
// Before the transport. What the pressure has been asked to give: SolidWork::next_volume.
VolumeTarget volume_target(const solid::SolidRest& rest, const solid::SolidState& state, const solid::SolidWork& work);
std::vector<VolumeTarget> volume_targets(const std::vector<solid::SolidRest>& rest, const SolidStates& states,
                                         const SolidWorks& work);
// After it, with the masses of the new state. before: the momenta at the start of the transport; without them no
// changes.
TransportChange transport_change(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                                 const solid::SolidWork& work, const VolumeTarget& target,
                                 const solid::Momenta& before);
std::vector<TransportChange> transport_changes(const Parallel& parallel, const std::vector<solid::SolidRest>& rest,
                                               const SolidStates& states, const SolidWorks& work,
                                               const std::vector<VolumeTarget>& targets,
                                               const std::vector<solid::Momenta>& before);

}  // namespace efsi::sim
