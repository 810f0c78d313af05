#include "system/stiffness_shares.hpp"

#include <algorithm>

#include "solid/map/credible.hpp"

namespace efsi::system {
namespace {

constexpr double kAlpha = 0.05, kWallAlpha = 1.0 / 3.0;  // of HHT-alpha
constexpr double kUndampedPace = 1.25, kUndampedStrain = 0.1, kUndampedGrowth = 1.25,
                 kUndampedLoad = 0.4;  // from here to twice as much it fades
constexpr double kDampedImplicit = 0.6, kImplicitOfPace = 0.4;
constexpr double kFromSpoiledToCrushed = 0.1, kCrushedViscosity = 30.0;

// 1 up to `from`, 0 from twice as much on.
double fade(double value, double from) { return std::clamp(2.0 - value / from, 0.0, 1.0); }

// Damped, and as much of HHT-alpha in place of that as `undamped` says.
StiffnessShares blend(double alpha, double pace, double undamped) {
  const double damped = std::clamp(kImplicitOfPace * pace, kDampedImplicit, 1.0);
  // For what v changes by in the step: gamma = 1/2 + alpha, beta = (1 + alpha)^2 / 4.
  const double beta = 0.25 * (1.0 + alpha) * (1.0 + alpha), implicit = beta * (1.0 - alpha),
               memory = (beta - alpha) * alpha;
  return {damped + undamped * (implicit - damped), undamped * implicit, undamped * memory};
}

}  // namespace

StiffnessShares stiffness_shares(double pace, double strain, double growth) {
  return blend(kAlpha, pace,
               std::min({fade(pace, kUndampedPace), fade(strain, kUndampedStrain), fade(growth, kUndampedGrowth)}));
}

StiffnessShares stiffness_shares_on_walls(double pace, double growth, double load) {
  return blend(kWallAlpha, pace,
               std::min(fade(pace, kUndampedPace), fade(growth, kUndampedGrowth)) * fade(load, kUndampedLoad));
}

double crushed_viscosity(double volume, bool yields) {
  const double growth = std::max(volume, 1.0 / volume), spoiled = yields ? solid::kSpoiledClay : solid::kSpoiledGrowth;
  return kCrushedViscosity * std::clamp((growth - spoiled) / kFromSpoiledToCrushed, 0.0, 1.0);
}

}  // namespace efsi::system
