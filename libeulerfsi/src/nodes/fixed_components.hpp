// Purpose: which components of the velocity walls fix.
#pragma once

#include "frame/scene.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// By the faces, less where a solid slides. matter.fixed holds zeros or what the last call left, or is empty.
void find_fixed_components(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                           const SolidWorks& solids, Matter& matter);
// They have the velocity of the walls.
void enforce_walls(const Parallel& parallel, const CommonGrid& common, const std::vector<std::uint8_t>& fixed,
                   grid::VectorField& velocity);

}  // namespace efsi::sim
