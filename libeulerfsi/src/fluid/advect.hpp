// Purpose: transport of the fluid's velocity and of smoke.
// Paper: Alg. 1 line 22; Eq. 3.
// Departs from the paper: clamped MacCormack correction away from solids; the paper's plain
// semi-Lagrangian advection is `corrected = false`.
#pragma once

#include "base/parallel.hpp"
#include "fluid/fluid.hpp"
#include "grid/tiles.hpp"

namespace efsi::fluid {

struct AdvectWorkspace {
  VectorField first, result;
  std::vector<Real> scalar_first, scalar_result, scalar_source;
};

// velocity: divergence-free; state.velocity := velocity carried by itself. Tiles that are at rest are copied.
// Returns the number of tiles of nodes visited.
std::uint64_t advect_velocity(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                              const std::vector<Real>& specific_volume, Real fluid_volume, const VectorField& velocity,
                              FluidState& state, AdvectWorkspace& work);

// Smoke and temperature; cells that are more than half solid (cell_fraction, may be empty) hold none.
// Returns the number of tiles of cells visited.
std::uint64_t advect_smoke(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                           const VectorField& velocity, const std::vector<Real>& cell_fraction, FluidState& state,
                           AdvectWorkspace& work);

}  // namespace efsi::fluid
