// Purpose: the volume that jets bring into the box: a source in the constraint of Eq. 11 (docs/numerics/jets.md).
#pragma once

#include "fluid/emitter.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// What emitters bring into the fluid in this step, cell by cell.
using Jets = std::vector<fluid::SourceCell>;

// Largest component of the velocity of the scene's emitters within `remaining` [m/s].
double fastest_jet(const Scene& scene, double time, double remaining);
// Adds what emitters bring in this step to `source`, wanted divergence per padded cell [1/s], which may be empty.
// StepInfo::jets: their flux. Nothing where the box has no open face: there it could not go anywhere.
void add_jets(const StepContext& step, const Matter& matter, Jets& jets, std::vector<Real>& source);

}  // namespace efsi::sim
