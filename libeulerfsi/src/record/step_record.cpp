#include "record/step_record.hpp"

#include <algorithm>
#include <cmath>

#include "base/kernel.hpp"
#include "solid/surface/surface.hpp"

namespace efsi::sim {
namespace {

EFSI_KERNEL Real largest(std::size_t n, const Real* values) {
  Real top = 0;
#pragma omp simd reduction(max : top)
  for (std::size_t i = 0; i < n; ++i) top = std::max(top, std::abs(values[i]));
  return top;
}

// Where only[i] is all[i].
EFSI_KERNEL Real largest(std::size_t n, const Real* values, const Real* only, const Real* all) {
  Real top = 0;
#pragma omp simd reduction(max : top)
  for (std::size_t i = 0; i < n; ++i) top = std::max(top, only[i] == all[i] ? std::abs(values[i]) : Real(0));
  return top;
}

// The largest of largest_of(nodes, first node, values) over the components and planes of nodes.
template <class Plane>
double largest_of_planes(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity,
                         const Plane& largest_of) {
  const std::size_t plane = g.node_stride(2);
  return parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t k) {
    const std::size_t first = static_cast<std::size_t>(k) * plane;
    Real top = 0;
    for (const auto& c : velocity.c) top = std::max(top, largest_of(plane, first, c.data() + first));
    return static_cast<double>(top);
  });
}

}  // namespace

void report_solids(const SolidWorks& work, StepInfo& info) {
  for (std::size_t l = 0; l < work.size(); ++l) {
    info.max_speed_solid = std::max(info.max_speed_solid, work[l].max_speed);
    info.min_det_f = l == 0 ? work[l].min_det_f : std::min(info.min_det_f, work[l].min_det_f);
    info.max_det_f = l == 0 ? work[l].max_det_f : std::max(info.max_det_f, work[l].max_det_f);
    info.degenerate_cells += work[l].degenerate + work[l].rejected;
  }
}

double largest_component(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity) {
  return largest_of_planes(parallel, g, velocity,
                           [](std::size_t n, std::size_t, const Real* values) { return largest(n, values); });
}

double largest_component(const Parallel& parallel, const grid::Grid& g, const grid::VectorField& velocity,
                         const std::vector<Real>& fluid_mass, const std::vector<Real>& mass) {
  return largest_of_planes(parallel, g, velocity, [&](std::size_t n, std::size_t first, const Real* values) {
    return largest(n, values, fluid_mass.data() + first, mass.data() + first);
  });
}

VolumeTarget volume_target(const solid::SolidRest& rest, const solid::SolidState& state, const solid::SolidWork& work) {
  VolumeTarget target{solid::volume_ratio(rest, state), work.volume / state.rest_volume_cells};
  if (!(work.next_volume > 0.0)) return target;
  target.cells += work.next_volume - target.mesh;
  target.mesh = work.next_volume;
  return target;
}

std::vector<VolumeTarget> volume_targets(const std::vector<solid::SolidRest>& rest, const SolidStates& states,
                                         const SolidWorks& work) {
  std::vector<VolumeTarget> targets;
  for (std::size_t l = 0; l < states.size(); ++l) targets.push_back(volume_target(rest[l], states[l], work[l]));
  return targets;
}

TransportError transport_error(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                               const solid::SolidWork& work, const VolumeTarget& target, const solid::Momenta& before) {
  TransportError change;
  if (!rest.compressible && state.whole) {
    change.volume_mesh = solid::volume_ratio(rest, state) - target.mesh;
    change.volume_cells = work.volume / state.rest_volume_cells - target.cells;
  }
  const solid::Momenta now = solid::measure_momenta(parallel, state.band, work, state.band.grid, state.v);
  change.momentum = now.linear - before.linear;
  change.angular_momentum = now.angular - before.angular;
  if (state.whole && work.cell_mass > 0.0)
    change.mass = work.cell_mass / (rest.density * state.rest_volume_cells) - 1.0;
  return change;
}

std::vector<TransportError> transport_errors(const Parallel& parallel, const std::vector<solid::SolidRest>& rest,
                                             const SolidStates& states, const SolidWorks& work,
                                             const std::vector<VolumeTarget>& targets,
                                             const std::vector<solid::Momenta>& before) {
  std::vector<TransportError> changes;
  for (std::size_t l = 0; l < before.size(); ++l)
    changes.push_back(transport_error(parallel, rest[l], states[l], work[l], targets[l], before[l]));
  return changes;
}

}  // namespace efsi::sim
