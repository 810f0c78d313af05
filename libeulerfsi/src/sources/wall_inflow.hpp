// Purpose: what comes in through walls that solids leave, and where solids leave each other.
#pragma once

#include "contact/wall_row.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// In a closed box the fluid gives what comes in through walls that solids leave, and where solids leave each other: it
// fills the gap, which is thinner than a cell. balanced: what the source allows for already [m^3/s].
void balance_inflow(const StepContext& step, const SolidWorks& solids, const Matter& matter,
                    const NodeVelocity& velocity, const std::vector<WallRow>& rows, double& balanced,
                    std::vector<Real>& source);

}  // namespace efsi::sim
