// Purpose: in a slab (docs/numerics/slabs.md) nothing moves or changes along one axis. The stages keep to that but for
// rounding, and this to the last bit.
#pragma once

#include <optional>

#include "frame/params.hpp"
#include "geometry/slab.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

// The box, if it is a slab.
std::optional<geometry::Slab> slab_of(const Params& params, const grid::Grid& box);

// The upper layer of nodes becomes what the lower one is, and what points along the axis 0.
void flatten(const Parallel& parallel, const grid::Grid& g, int axis, grid::VectorField& field);
// The same for a solid: its fields, and no point of its surface has moved along the axis.
void flatten(const Parallel& parallel, const solid::SolidRest& rest, int axis, solid::SolidState& state);

}  // namespace efsi::sim
