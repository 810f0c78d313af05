// Purpose: the frames in which the velocity fields of solids are carried that walls hold.
#pragma once

#include <span>

#include "contact/hold.hpp"
#include "contact/wall_row.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// The walls with rows of solid l that hold it along these axes. center: of its mass [m].
solid::WallPlanes walls_of(const grid::Grid& box, std::span<const WallRow> rows, std::size_t l, unsigned axes,
                           const Vec3d& center);

// Adds the affine flow of each solid that walls hold and nothing else, and that does not yield: frames[l].flow.
// momenta: of its velocity, by which its centre slides on along the walls.
void strain_wall_frames(const StepContext& step, const Holds& holds, std::span<const WallRow> rows,
                        const SolidStates& states, const SolidWorks& solids, const std::vector<solid::Momenta>& momenta,
                        const grid::Grid& common, NodeVelocity& velocity, std::vector<solid::BodyStep>& frames);

}  // namespace efsi::sim
