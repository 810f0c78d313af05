#include "solve/bulk.hpp"

#include <algorithm>
#include <cmath>

#include "frame/grid_loops.hpp"
#include "linalg/reduce.hpp"
#include "solid/element/dilatation.hpp"
#include "solid/element/mass.hpp"
#include "solid/map/credible.hpp"
#include "sources/volume_source.hpp"

namespace efsi::sim {
namespace {

// Of a dilatation in a step: beyond it the step, linear in the divergence, is further off (growth² / 2) than det F.
constexpr double kMostDilation = 0.25;

// Calls body(solid, its band cell, padded cell) for the cells that solids with a bulk stiffness own.
template <class Body>
void for_bulk_cells(const StepContext& step, const SolidStates& states, const Matter& matter, const Body& body) {
  for (std::size_t l = 0; l < states.size(); ++l) {
    if (!(step.scene.solids[l].bulk > 0.0)) continue;
    for_owned_cells(step.parallel, matter.common.grid, matter.owned, l, states[l].band,
                    [&](std::size_t cell, std::size_t c) { body(l, c, cell); });
  }
}

bool any_bulk(const Scene& scene) {
  for (const solid::SolidRest& rest : scene.solids)
    if (rest.bulk > 0.0) return true;
  return false;
}

}  // namespace

void compute_compliance(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const Matter& matter, const std::vector<std::uint8_t>& active, std::vector<Real>& compliance) {
  if (!any_bulk(step.scene)) return;
  const grid::Grid& g = matter.common.grid;
  linalg::fill(step.parallel, compliance, g.padded_count(), Real(0));
  for_bulk_cells(step, states, matter, [&](std::size_t l, std::size_t c, std::size_t cell) {
    if (!active.empty() && !active[cell]) return;
    const solid::SolidWork& work = solids[l];
    const solid::SolidRest& rest = step.scene.solids[l];
    const auto e = static_cast<std::size_t>(work.element[c]);
    const double kappa = rest.bulk * solid::bulk_weight(rest, work, e);
    const double ratio = static_cast<double>(work.dilatation[e]);
    compliance[cell] = static_cast<Real>(g.h * g.h * g.h / (step.dt * step.dt * kappa * ratio));
  });
}

void add_bulk_source(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     std::vector<Real>& source) {
  if (!any_bulk(step.scene)) return;
  if (source.empty()) linalg::fill(step.parallel, source, matter.common.grid.padded_count(), Real(0));
  for_bulk_cells(step, states, matter, [&](std::size_t l, std::size_t c, std::size_t cell) {
    const double ratio = static_cast<double>(solids[l].dilatation[static_cast<std::size_t>(solids[l].element[c])]);
    source[cell] += static_cast<Real>((1.0 - ratio) / (ratio * step.dt));
  });
}

void carry_dilatation(const StepContext& step, std::size_t l, const Matter& matter, const PressureEquation& pressure,
                      const solid::SolidWork& work, solid::SolidState& state) {
  if (state.dilatation.empty() || pressure.compliance.empty()) return;
  std::vector<double> next(work.element_cell.size(), 0.0);
  for_owned_cells(step.parallel, matter.common.grid, matter.owned, l, state.band, [&](std::size_t cell, std::size_t c) {
    const auto e = static_cast<std::size_t>(work.element[c]);
    const double ratio = static_cast<double>(work.dilatation[e]);
    double growth = 0.0;  // of what no pressure acts on there is none
    if (pressure.compliance[cell] > 0) {
      growth = step.dt * static_cast<double>(pressure.source[cell]);
      if (step.scene.params.numerics.volume_source)
        growth -= step.dt * return_rate(step.dt, work, c) * static_cast<double>(work.fraction[c]);
    }
    const double grown = std::clamp(ratio * (1.0 + growth), 1.0 / solid::kMostDetF, solid::kMostDetF);
    next[e] = std::abs(growth) > kMostDilation ? solid::kForgotten : grown;
  });
  solid::carry_dilatation(step.parallel, step.scene.solids[l], work, next, state);
}

void deform_by_pressure(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& q,
                        PressureEquation& pressure) {
  if (pressure.compliance.empty()) return;
  const Real scale = static_cast<Real>(1.0 / (g.h * g.h * g.h));
  std::vector<Real>& source = pressure.source;
  const std::vector<Real>& compliance = pressure.compliance;
  parallel.for_ranges(static_cast<std::int64_t>(source.size()), [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c)
      if (compliance[c] > 0) source[c] += scale * compliance[c] * q[c];
  });
}

}  // namespace efsi::sim
