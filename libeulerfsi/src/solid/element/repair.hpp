// Purpose: puts broken cells of an incompressible solid back in shape.
// Where a solid folds onto itself, the maps of both sides meet at one node; the cells between are stretched or turned
// over step by step, and with them what they push (docs/numerics/repair.md). The paper has no such step; its filter,
// which acts everywhere, serves this too.
#pragma once

#include "base/parallel.hpp"
#include "solid/map/credible.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// det F over the full cells of a solid, 1 where there is none; an inverted cell counts as 10, and nothing is below 0.1
// (SolidWork::volume_ratio). broken: those that repair_map puts back, of an incompressible solid.
struct MapQuality {
  double min_det_f = 1.0, max_det_f = 1.0;
  std::uint64_t broken = 0;
};
// Of what compute_mass has found.
MapQuality inspect_map(const SolidRest& rest, const SolidWork& work);

// A cell inside an incompressible solid is broken when its det F is off by more than kMostGrowth from what the solid
// has as a whole. Its corners are moved, as little as may be, until it is not, and in up to ten sweeps what that breaks
// beside it; there the velocities become smooth. Reads what compute_mass has made of state; where it returns more than
// 0, the number of cells it found broken, it has changed state.u and state.v and called compute_mass anew.
std::uint64_t repair_map(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work);

}  // namespace efsi::solid
