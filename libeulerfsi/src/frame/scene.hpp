// Purpose: what a step does not change: parameters, grid of the box, solids at rest, emitters, forces, pins.
#pragma once

#include <vector>

#include "fluid/emitter.hpp"
#include "frame/force_field.hpp"
#include "frame/given_motion.hpp"
#include "frame/params.hpp"
#include "grid/grid.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

struct Scene {
  const Params& params;
  const grid::Grid& grid;
  const std::vector<solid::SolidRest>& solids;
  const std::vector<fluid::Emitter>& emitters;
  const std::vector<ForceField>& forces;
  const std::vector<Pin>& pins;
};

// Per solid, in the scene's order: what survives a step, and what does not.
using SolidStates = std::vector<solid::SolidState>;
using SolidWorks = std::vector<solid::SolidWork>;

}  // namespace efsi::sim
