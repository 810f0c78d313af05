// Purpose: second order in time for the fluid with one projection: half of a step's pressure acts before the transport.
// Departs from the paper (docs/numerics/carried-pressure.md).
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "frame/scene.hpp"
#include "frame/window.hpp"

namespace efsi::sim {

// The part of the pressure [Pa], padded cells, whose gradient acts in the half of a step before the transport: half of
// it away from solids and open faces, nothing in the bands of solids and at open faces.
void take_carried_pressure(const Parallel& parallel, const CommonGrid& common, const SolidStates& states,
                           const std::vector<Real>& pressure, std::vector<Real>& carried);

// A velocity between two steps has half of what the pressure makes of it at one time: the carried part. It gets the
// other half, with which its divergence is of second order in dt. density: of the fluid; q: scratch.
void act_once_more(const Parallel& parallel, const CommonGrid& common, const SolidStates& states,
                   const std::vector<Real>& pressure, double dt, double density, std::vector<Real>& q,
                   grid::VectorField& velocity);

}  // namespace efsi::sim
