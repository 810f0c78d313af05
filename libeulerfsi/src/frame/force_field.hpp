// Purpose: forces that act in a region: constant, radial, wind with noise (docs/numerics/forces.md).
#pragma once

#include "fluid/fluid.hpp"

namespace efsi::sim {

struct ForceField : fluid::Region {
  // Values equal EFSI_FORCE_* and EFSI_ACTS_ON_*.
  enum class Kind : std::int32_t { kConstant = 0, kRadial = 1, kWind = 2 };
  enum class ActsOn : std::int32_t { kBoth = 0, kFluid = 1, kSolids = 2 };
  Kind kind = Kind::kConstant;
  ActsOn acts_on = ActsOn::kBoth;
  Vec3d acceleration = Vec3d::Zero();   // constant [m/s^2]
  double radial_acceleration = 0.0;     // radial: away from the middle of the region [m/s^2]
  Vec3d wind_velocity = Vec3d::Zero();  // wind [m/s]
  double wind_drag = 1.0;               // rate at which it takes matter along [1/s]
  double noise_speed = 0.0;             // root of the mean square of what is added to the wind [m/s]
  double noise_size = 0.1;              // of its eddies [m]
  double noise_frequency = 0.0;         // at which they change [1/s]
  double start_time = 0.0, end_time = 0.0;

  // What it adds to the velocity v at x, in the region, from `time` on for `duration` [s].
  Vec3d velocity_change(const Vec3d& x, const Vec3d& v, double time, double duration) const;
};

// A velocity field without divergence: root of the mean square 1, features of size 1. time: it changes by about its own
// size in 1. The same on every machine.
Vec3d noise_velocity(const Vec3d& x, double time);

}  // namespace efsi::sim
