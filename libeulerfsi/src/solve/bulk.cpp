#include "solve/bulk.hpp"

#include "frame/grid_loops.hpp"
#include "linalg/reduce.hpp"
#include "solid/element/mass.hpp"

namespace efsi::sim {
namespace {

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
                        const Matter& matter, std::vector<Real>& compliance) {
  if (!any_bulk(step.scene)) return;
  const grid::Grid& g = matter.common.grid;
  linalg::fill(step.parallel, compliance, g.padded_count(), Real(0));
  for_bulk_cells(step, states, matter, [&](std::size_t l, std::size_t c, std::size_t cell) {
    const solid::SolidWork& work = solids[l];
    const solid::SolidRest& rest = step.scene.solids[l];
    const double kappa = rest.bulk * solid::bulk_weight(rest, work, static_cast<std::size_t>(work.element[c]));
    const double J = static_cast<double>(work.volume_ratio[c]);
    compliance[cell] = static_cast<Real>(g.h * g.h * g.h / (step.dt * step.dt * kappa * J));
  });
}

void add_bulk_source(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     std::vector<Real>& source) {
  if (!any_bulk(step.scene)) return;
  if (source.empty()) linalg::fill(step.parallel, source, matter.common.grid.padded_count(), Real(0));
  for_bulk_cells(step, states, matter, [&](std::size_t l, std::size_t c, std::size_t cell) {
    const double J = static_cast<double>(solids[l].volume_ratio[c]);
    source[cell] += static_cast<Real>((1.0 - J) / (J * step.dt));
  });
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
