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

// Root of the sum of the squares of a pressure about its mean; 0 of none.
double spread_of(const Parallel& parallel, const grid::Grid& g, std::vector<Real>& pressure);

// Takes the part that was carried in a step of dt out of the velocity after it: forces and solids are not ahead by half
// a step. density: of the fluid; q: scratch.
void take_back_carried(const Parallel& parallel, const CommonGrid& common, const SolidStates& states,
                       const std::vector<Real>& pressure, double dt, double density, std::vector<Real>& q,
                       grid::VectorField& velocity);

}  // namespace efsi::sim
