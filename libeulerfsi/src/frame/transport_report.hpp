// Purpose: what a step reports of its transport: cells that it changed because their map could not be, and what the
// transport loses. transport/repair_maps.hpp and record/step_record.hpp fill it.
#pragma once

#include <cstdint>

#include "base/math_types.hpp"

namespace efsi::sim {

// Cells that a step changed because their map could not be, counted before anything acts, and det F of full cells
// before and after. Sums and extremes over the solids (EfsiRepairs).
struct Repairs {
  std::uint64_t clamped = 0;         // cells whose F was clamped in the forces
  std::uint64_t rejected = 0;        // cells whose map was rejected after the transport
  std::uint64_t broken = 0;          // of incompressible solids: det F out of bounds after the transport
  std::uint64_t repaired_cells = 0;  // cells that the repair moved, with those that it broke itself
  double min_det_f_before = 1.0, max_det_f_before = 1.0, min_det_f_after = 1.0, max_det_f_after = 1.0;
};

// What the transport of a step changes in a solid's volume and momenta before anything restores them
// (EfsiTransportError).
struct TransportError {
  double volume_mesh = 0.0, volume_cells = 0.0;  // less what the pressure gave, over the volume at rest; incompressible
  Vec3d momentum = Vec3d::Zero();                // [kg m/s]
  Vec3d angular_momentum = Vec3d::Zero();        // about the centre of mass [kg m^2/s]
  double mass = 0.0;                             // by cell fractions, relative to the first step's, minus 1
};

}  // namespace efsi::sim
