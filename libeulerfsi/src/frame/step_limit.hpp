// Purpose: what made a step as long as it is: the rule, and the bodies that it looked at.
#pragma once

#include <cstddef>
#include <cstdint>

namespace efsi::sim {

// As EfsiStepRule.
enum class StepRule : std::int32_t {
  kEnd = 0,          // the end of the duration, in one step
  kMaximum = 1,      // max_time_step
  kSpeed = 2,        // the speed of a solid
  kStrain = 3,       // the strain or turn of a solid in flight
  kWall = 4,         // the approach of a solid to a wall
  kWallWave = 5,     // what a solid at a wall may lose of its energy, or shear waves in it
  kSolid = 6,        // the approach of two bodies
  kSolidWave = 7,    // the same at another body
  kFold = 8,         // the approach of folds of a solid
  kFoldWave = 9,     // the same where its folds touch
  kStart = 10,       // the first step of a solid in a dense fluid
  kCollider = 11,    // the speed of a collider
  kFluid = 12,       // the speed of the fluid, a wall or a jet
  kRepeated = 13,    // a step that was rolled back
  kFlightWave = 14,  // as kWallWave, in flight
};

// The least of the limits so far. Bodies are numbers from 1, 0: none.
struct StepLimit {
  double dt;
  StepRule rule;
  std::uint32_t solid = 0, other = 0;

  void lower(double to, StepRule by, std::size_t body = 0, std::size_t with = 0) {
    if (to < dt) *this = {to, by, static_cast<std::uint32_t>(body), static_cast<std::uint32_t>(with)};
  }
};

}  // namespace efsi::sim
