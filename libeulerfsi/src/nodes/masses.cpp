#include "nodes/masses.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "nodes/fixed_components.hpp"
#include "nodes/slip_nodes.hpp"
#include "solid/element/mass.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// The common grid follows the solids, and with it what is kept of it.
void follow_solids(const Scene& scene, const SolidStates& states, const SolidWorks& solids, Window& window,
                   std::vector<Real>& pressure, Matter& matter) {
  const Window next = choose_window(scene.params, scene.grid, states, solids);
  const CommonGrid common = cut(scene.params, scene.grid, next);
  if (common.grid.cells != matter.common.grid.cells) matter.fixed.clear();
  matter.common = common;
  if (next == window) return;
  pressure = move_cells(pressure, window, next);
  window = next;
}

void add_fractions(const Parallel& parallel, const SolidStates& states, const SolidWorks& solids, Matter& matter) {
  const Grid& g = matter.common.grid;
  linalg::fill(parallel, matter.cell_fraction, g.cell_count(), Real(0));
  for (std::size_t l = 0; l < solids.size(); ++l)
    for_band_cells(parallel, g, states[l].band, [&](std::size_t c, int i, int j, int k) {
      Real& fraction = matter.cell_fraction[g.cell(i, j, k)];
      fraction = std::min(Real(1), fraction + solids[l].fraction[c]);
    });
}

// `values` at all nodes: full(i, j, k), which is the same between the faces of a row.
template <class Full>
void fill_rows(const Grid& g, int k, const Full& full, std::vector<Real>& values) {
  const int last = g.cells[0];
  for (int j = 0; j <= g.cells[1]; ++j) {
    Real* row = values.data() + g.node(0, j, k);
    row[0] = full(0, j, k);
    std::fill(row + 1, row + last, full(1, j, k));
    row[last] = full(last, j, k);
  }
}

// The part of the 8 cells around a node that no solid fills, in cells; 8 less those beyond the box; -1: no solid is
// there.
double free_cells(const Matter& matter, int i, int j, int k) {
  const Grid& g = matter.common.grid;
  double share = 0.0;
  bool any = false;
  for (const auto& corner : grid::kCorner) {
    int q[3] = {i - corner[0], j - corner[1], k - corner[2]};
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int n = g.cells[a];
      if (g.periodic[a]) q[a] = (q[a] + n) % n;
      inside = inside && q[a] >= 0 && q[a] < n;
    }
    if (!inside) continue;
    const double fraction = static_cast<double>(matter.cell_fraction[g.cell(q[0], q[1], q[2])]);
    any = any || fraction > 0.0;
    share += 1.0 - fraction;
  }
  return any ? share : -1.0;
}

// The fluid fills what the solids leave free.
void weigh(const Parallel& parallel, double fluid_density, const SolidStates& states, const SolidWorks& solids,
           Matter& matter) {
  const Grid& g = matter.common.grid;
  const double eighth = static_cast<double>(static_cast<Real>(fluid_density)) * (g.h * g.h * g.h) / 8.0;
  matter.fluid_mass.resize(g.node_count());
  matter.mass.resize(g.node_count());
  const auto full = [&](int i, int j, int k) { return static_cast<Real>(eighth * adjacent_cells(g, i, j, k)); };
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t k) {
    fill_rows(g, static_cast<int>(k), full, matter.fluid_mass);
    fill_rows(g, static_cast<int>(k), full, matter.mass);
  });
  for (const solid::SolidState& state : states)
    for_band_nodes(parallel, g, state.band, [&](std::size_t, int i, int j, int k) {
      const double share = free_cells(matter, i, j, k);
      const std::size_t n = g.node(i, j, k);
      if (share >= 0.0) matter.mass[n] = matter.fluid_mass[n] = static_cast<Real>(eighth * share);
    });
  for (std::size_t l = 0; l < states.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      const Real m = solids[l].mass[local];
      if (m > 0) matter.mass[g.node(i, j, k)] += m;
    });
}

void find_specific_volume(const Parallel& parallel, const fluid::FluidParams& fluid, const SolidStates& states,
                          Matter& matter) {
  const Grid& g = matter.common.grid;
  const double h3 = g.h * g.h * g.h;
  const Real fluid_volume = fluid.present ? static_cast<Real>(1.0 / fluid.density) : Real(0);
  linalg::fill(parallel, matter.specific_volume, g.node_count(), fluid_volume);
  for (const solid::SolidState& state : states)
    for_band_nodes(parallel, g, state.band, [&](std::size_t, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      const double full = h3 / 8.0 * adjacent_cells(g, i, j, k);
      const double m = static_cast<double>(matter.mass[n]);
      const Real exact = static_cast<Real>(m > 0.0 ? full / m : 0.0);
      const bool pure = static_cast<double>(fluid_volume) > 0.0 &&
                        std::abs(static_cast<double>(exact) / static_cast<double>(fluid_volume) - 1.0) < 1e-5;
      matter.specific_volume[n] = pure ? fluid_volume : exact;
    });
}

// Where solids overlap a cell belongs to the one that fills more of it.
void find_owned_cells(const Parallel& parallel, const SolidStates& states, const SolidWorks& solids, Matter& matter) {
  const Grid& g = matter.common.grid;
  matter.owned.assign(states.empty() ? 0 : g.padded_count(), 0);
  const auto fraction = [&](std::size_t l, int i, int j, int k) {
    const Vec3i lo = grid::offset(states[l].band.grid, g);
    return solids[l].fraction[states[l].band.grid.cell(i - lo[0], j - lo[1], k - lo[2])];
  };
  for (std::size_t l = 0; l < states.size(); ++l)
    for_band_cells(parallel, g, states[l].band, [&](std::size_t c, int i, int j, int k) {
      if (!solids[l].owns(c)) return;
      std::uint8_t& owner = matter.owned[g.padded(i, j, k)];
      if (owner == 0 || solids[l].fraction[c] > fraction(owner - 1u, i, j, k)) owner = static_cast<std::uint8_t>(l + 1);
    });
}

// The film between solids that touch: what they leave of cells that none owns may be nothing, and weighs a little.
void leave_film(const Parallel& parallel, double fluid_density, const SolidStates& states, const SolidWorks& solids,
                Matter& matter) {
  if (states.size() < 2 || !(fluid_density > 0.0)) return;
  constexpr double kFilmMass = 0.25;  // of full cells
  const Grid& g = matter.common.grid;
  const double eighth = fluid_density * (g.h * g.h * g.h) / 8.0;
  std::vector<std::uint8_t> bands(g.node_count(), 0);
  for (const solid::SolidState& state : states)
    for_band_nodes(parallel, g, state.band, [&](std::size_t, int i, int j, int k) { ++bands[g.node(i, j, k)]; });
  for (std::size_t l = 0; l < states.size(); ++l)
    for_band_nodes(parallel, g, states[l].band, [&](std::size_t local, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k);
      if (bands[n] < 2 || !solids[l].carries[local]) return;
      const Real least = static_cast<Real>(
          kFilmMass * eighth * std::popcount(static_cast<unsigned>(cells_owned_by(g, matter.owned, 0, i, j, k))));
      if (!(matter.fluid_mass[n] < least)) return;
      matter.mass[n] += least - matter.fluid_mass[n];
      matter.fluid_mass[n] = least;
    });
}

}  // namespace

void compute_masses(const StepContext& step, const SolidStates& states, SolidWorks& solids) {
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l) {
    ScopedTimer timer(step.profile, Stage::kSolidMass);
    solid::compute_mass(step.parallel, step.scene.solids[l], states[l], solids[l]);
    timer.visited(solids[l].mass.size(), 5 * sizeof(Real));
  }
}

void combine_masses(const StepContext& step, const SolidStates& states, const SolidWorks& solids, Window& window,
                    std::vector<Real>& pressure, Matter& matter, system::SlipNodes& slip) {
  const fluid::FluidParams& fluid = step.scene.params.fluid;
  ScopedTimer timer(step.profile, Stage::kSolidMass);
  follow_solids(step.scene, states, solids, window, pressure, matter);
  if (step.scene.solids.empty() && !matter.specific_volume.empty()) return;  // nothing has moved
  find_fixed_components(step.parallel, step.scene, states, solids, matter);
  find_owned_cells(step.parallel, states, solids, matter);
  if (!step.scene.solids.empty()) {
    const double density = fluid.present ? fluid.density : 0.0;
    add_fractions(step.parallel, states, solids, matter);
    weigh(step.parallel, density, states, solids, matter);
    if (step.scene.params.numerics.unilateral_walls) leave_film(step.parallel, density, states, solids, matter);
    timer.visited(matter.mass.size(), 2 * sizeof(Real));
  }
  find_specific_volume(step.parallel, fluid, states, matter);
  slip = find_slip_nodes(step.parallel, step.scene, states, solids, matter);
}

}  // namespace efsi::sim
