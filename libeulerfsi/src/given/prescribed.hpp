// Purpose: pins and colliders in a step: nodes of solids whose velocity is given. It enters Eq. 8 as what is
// prescribed, such nodes have no W in the projection (Eq. 12: their mass is infinite), and the map there follows from
// the pose:
//   v = V + omega x (x - c) of the pose at the start of the step,   u = x - X(x) of that at its end
// The reaction is reported as an impulse per pin (docs/numerics/given-motion.md).
#pragma once

#include "frame/reaction.hpp"
#include "frame/step_context.hpp"
#include "given/given_node.hpp"
#include "nodes/node_fields.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// Before anything else in a step from `time` on: velocities of colliders and speeds of what is given, for its size.
void begin_prescribed(const Parallel& parallel, const Scene& scene, double time, double remaining, SolidStates& states);
// With the masses of the step: the given nodes and their velocities; takes their W away.
std::vector<PrescribedNode> find_prescribed(const StepContext& step, const SolidStates& states,
                                            const SolidWorks& solids, Matter& matter, system::SlipNodes& slip);
// With all forces but the solids' own: the nodes get their velocities. Starts the count of the impulses, in which a
// collider has no mass.
void prescribe_velocity(const StepContext& step, const SolidWorks& solids, const Matter& matter,
                        std::vector<PrescribedNode>& given, NodeVelocity& velocity);
// The nodes have what is given again, after something else has changed velocities.
void restore_given(const std::vector<PrescribedNode>& given, NodeVelocity& velocity);
// Eq. 8: prescribes what they have.
void fix_prescribed(const std::vector<PrescribedNode>& given, system::VelocitySystem& system);
// Cells at which nothing can move have no pressure. active: as PressureSystem has it; filled where it is empty.
void close_prescribed_cells(const StepContext& step, const SolidStates& states, const Matter& matter,
                            const system::SlipNodes& slip, std::vector<std::uint8_t>& active);
// Impulses on pinned nodes, in the velocity solve or by the pressure.
void add_pin_reactions(const Reaction& reaction, std::vector<PrescribedNode>& given);
// Reaction of each pin during the step.
std::vector<PinReaction> sum_reactions(const StepContext& step, const grid::Grid& grid,
                                       const std::vector<PrescribedNode>& given);
// After the transport of solid l: map and velocity, then the vertices, where its pins hold it.
void prescribe_map(const StepContext& step, std::size_t l, solid::SolidState& state);
void prescribe_surface(const StepContext& step, std::size_t l, solid::SolidState& state);
// Instead of its transport: solid l, a collider, where it is at the end of the step, in a band of its own.
void place_collider(const StepContext& step, std::size_t l, solid::SolidState& state, solid::SolidWork& work);

}  // namespace efsi::sim
