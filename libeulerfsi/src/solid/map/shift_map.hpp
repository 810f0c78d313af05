// Purpose: moves a solid as it is by a small part of a cell: what its transport has left of the way of its centre.
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// The map of a solid and its surface, moved by `offset` [m], to first order: u(x) becomes u(x - offset) + offset.
void shift_map(const Parallel& parallel, const Vec3d& offset, SolidState& state);

}  // namespace efsi::solid
