// Purpose: what gravity changes in a step.
// Departs from the paper: weight less buoyancy, so that the pressure does not hold the hydrostatic one
// (docs/deviations.md).
#pragma once

#include <vector>

#include "frame/scene.hpp"

namespace efsi::sim {

// In the velocities of the fluid and of each solid [m/s].
struct StepWeight {
  Vec3 fluid;
  std::vector<Vec3> solids;
};

// Weight less the buoyancy in an ambient density, whose hydrostatic pressure the pressure leaves out: the fluid's. So a
// solid floats by what it weighs and not by how the stairs of its cells sum up the pressure, and what has the fluid's
// density stays at rest. A light solid is not pushed up with more than kMostLift times its weight, which the elastic
// solve would follow before the pressure answers; the rest of its buoyancy is the pressure's.
inline constexpr double kMostLift = 1.0;
StepWeight weight_in_step(const Scene& scene, double dt, const SolidWorks& solids);

}  // namespace efsi::sim
