// Purpose: transport of the fluid's velocity and of smoke.
// Paper: Alg. 1 line 22; Eq. 3.
// Departs from the paper: clamped MacCormack correction away from solids, and hourglass modes of the velocity are taken
// out; the paper's plain semi-Lagrangian advection is `corrected = false`.
#pragma once

#include <array>

#include "base/parallel.hpp"
#include "fluid/conserve_smoke.hpp"
#include "fluid/emitter.hpp"
#include "grid/tiles.hpp"

namespace efsi::fluid {

struct AdvectWorkspace {
  VectorField carried;  // nodes: the velocity with the pressure's part before the transport
  VectorField first;    // nodes: what arrives before the correction; cells of smoke: how far from where it comes
  std::vector<Real> scalar_source, scalar_first;  // cells: what is carried, and what arrives before the correction
  std::vector<std::uint8_t> solid_cells;          // cells that are more than half solid before the transport; or empty
  std::array<ScalarBudget, 2> budgets;            // of smoke and temperature

  // What may live in arrays of others during a transport.
  std::array<std::vector<Real>*, 5> storage() {
    return {&first.c[0], &first.c[1], &first.c[2], &scalar_source, &scalar_first};
  }
  // What is carried lives where scalars and what arrives first have been, until the next call.
  void exchange_carried() {
    carried.c[0].swap(scalar_source);
    carried.c[1].swap(scalar_first);
    carried.c[2].swap(first.c[0]);
  }
  std::size_t bytes() const {
    return (3 * first.c[0].capacity() + scalar_source.capacity() + scalar_first.capacity()) * sizeof(Real) +
           solid_cells.capacity() + budgets[0].bytes() + budgets[1].bytes();
  }
};

// state.velocity := what is carried by the flow; three fields, or the flow itself is carried. Tiles that are at rest
// are copied. Returns the number of tiles of nodes visited.
std::uint64_t advect_velocity(const Parallel& parallel, const Grid& g, bool corrected, double dt,
                              const VectorField& flow, const VectorField& carried,
                              const std::vector<Real>& specific_volume, Real fluid_volume, FluidState& state,
                              AdvectWorkspace& work);

// Smoke and temperature; from cells that are more than half solid (cell_fraction, may be empty) comes what is beside
// them. sources: where fluid comes in with smoke of its own. settle_smoke has to follow. Returns the number of
// tiles of cells visited.
std::uint64_t advect_smoke(const Parallel& parallel, const Grid& g, bool corrected, double dt, const VectorField& flow,
                           const std::vector<Real>& cell_fraction, FluidState& state, AdvectWorkspace& work,
                           std::span<const SourceCell> sources = {});

// The rest of it, once the solids have moved, too: their cells are emptied and, where the transport was corrected, the
// amount that it has lost or gained is compensated nearby (conserve_smoke.hpp).
void settle_smoke(const Parallel& parallel, const Grid& g, const Walls& walls, const std::vector<Real>& cell_fraction,
                  FluidState& state, AdvectWorkspace& work);

}  // namespace efsi::fluid
