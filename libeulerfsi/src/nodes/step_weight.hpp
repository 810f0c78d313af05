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
// solid floats by its mass and not by the sum of the pressure over its voxelised boundary, and one of the fluid's
// density stays at rest. The upward force on a light solid is at most kMostLift times its weight, since the elastic
// solve would follow it before the pressure responds; the rest of its buoyancy is the pressure's.
inline constexpr double kMostLift = 1.0;
StepWeight weight_in_step(const Scene& scene, double dt, const SolidWorks& solids);

}  // namespace efsi::sim
