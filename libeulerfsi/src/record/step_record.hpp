// Purpose: what a step reports of the solids' speeds and maps, of the largest velocity, and of what the transport
// loses.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "frame/scene.hpp"
#include "frame/step_info.hpp"
#include "solid/momentum.hpp"

namespace efsi::sim {

// Speeds, det F and clamped cells of the solids after a step.
void report_solids(const SolidWorks& work, StepInfo& info);
// Largest component of a velocity at the nodes of a grid [m/s].
double largest_component(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity);
// The same of nodes without matter of a solid: fluid_mass and mass of all matter per node.
double largest_component(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity,
                         const std::vector<Real>& fluid_mass, const std::vector<Real>& mass);

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
TransportError transport_error(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                               const solid::SolidWork& work, const VolumeTarget& target, const solid::Momenta& before);
std::vector<TransportError> transport_errors(const Parallel& parallel, const std::vector<solid::SolidRest>& rest,
                                             const SolidStates& states, const SolidWorks& work,
                                             const std::vector<VolumeTarget>& targets,
                                             const std::vector<solid::Momenta>& before);

}  // namespace efsi::sim
