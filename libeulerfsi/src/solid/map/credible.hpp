// Purpose: how much strain of a map is believed, in one table (docs/numerics/credible-cells.md).
#pragma once

#include <algorithm>

#include "material/constitutive.hpp"

namespace efsi::solid {

struct StretchBounds {
  double least, most;
  double clamp(double stretch) const { return std::clamp(stretch, least, most); }
};

// Principal stretches, the less the map is known the fewer:
inline constexpr StretchBounds kElementStretch = {material::kFlat, 10.0};  // of an element: stress
inline constexpr StretchBounds kPlausibleStretch = {0.2, 5.0};  // of what is extrapolated in part, or has a wrong det F
inline constexpr StretchBounds kCutStretch = {0.25, 4.0};       // across the surface in a cell that it cuts
inline constexpr StretchBounds kSurfaceStretch = {0.4, 2.5};    // from the surface outwards; of what is repaired
inline constexpr StretchBounds kSliverStretch = {1.0 / 1.5, 1.5};    // of a sliver (docs/numerics/thin-parts.md)
inline constexpr StretchBounds kEnteringStretch = {1.0 / 1.5, 1.5};  // of a new element, against those beside it

inline constexpr double kMostDetF = 10.0;     // of a cell, or the inverse; what is inverted has it
inline constexpr double kFalseStretch = 4.0;  // of an edge of the surface, over the solid's largest stretch

// det F over that of the solid, or the inverse:
inline constexpr double kFlatGrowth = 2.0;       // beyond kPlausibleStretch: what is pressed flat keeps its volume
inline constexpr double kMostGrowth = 1.95;      // of a cell inside an incompressible solid; beyond, it is repaired
inline constexpr double kRepairedGrowth = 1.8;   // of a repaired cell: a margin to that
inline constexpr double kSpoiledGrowth = 1.4;    // of an element that keeps its volume; beyond, it is viscous
inline constexpr double kSpoiledClay = 1.1;      // the same where it yields
inline constexpr double kSplinterGrowth = 1.25;  // of an element that is torn off

}  // namespace efsi::solid
