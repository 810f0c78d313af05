// Purpose: the nodes at the surfaces of solids along which the fluid slips. Departs from the paper, which has one
// velocity at a node (docs/deviations.md).
#pragma once

#include "frame/scene.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// Not at walls, nor where solids meet, nor at gaps of less than a cell, whose corners all belong to solids.
system::SlipNodes find_slip_nodes(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                                  const SolidWorks& solids, const Matter& matter);

}  // namespace efsi::sim
