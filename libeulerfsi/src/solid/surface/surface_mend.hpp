// Purpose: points of the embedded surface that the map cannot carry travel with their neighbours in the material.
// Where a solid folds onto itself one map holds one of the sheets that meet, and beside thin parts it may hold nothing
// (docs/numerics/surface.md).
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Per point, `lost`: 1 where the map does not hold it; `extrapolated`: 1 where the map comes from the extension alone.
// Lost as well are the ends of torn edges (longer than at rest times the solid's largest stretch times that of
// kSurfaceStretch), what only torn edges join to the largest part of the surface and, while that
// does not mend it, more and more of what is around them, first where the map is extrapolated. Lost points move as the
// points around them at rest do that are kept, rigidly, the nearer the more: x = y + R (X - Y), Y and y weighted means
// of theirs; inside a lost region from its edge inwards. What no link of the clusters leads to stays where it is. Where
// nothing is lost no bit changes. On return `lost` marks all that was.
void repair_surface(const Parallel& parallel, const SolidRest& rest, double max_stretch,
                    const std::vector<std::uint8_t>& extrapolated, std::vector<std::uint8_t>& lost, SolidState& state);

}  // namespace efsi::solid
