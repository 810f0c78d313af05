#include "record/step_record.hpp"

#include <algorithm>

#include "solid/surface/surface.hpp"

namespace efsi::sim {
namespace {

// The quality of all solids' maps as one.
solid::MapQuality inspect(const std::vector<solid::SolidRest>& rest, const SolidWorks& work) {
  solid::MapQuality all;
  for (std::size_t l = 0; l < work.size(); ++l) {
    const solid::MapQuality one = solid::inspect_map(rest[l], work[l]);
    all.min_det_f = l == 0 ? one.min_det_f : std::min(all.min_det_f, one.min_det_f);
    all.max_det_f = l == 0 ? one.max_det_f : std::max(all.max_det_f, one.max_det_f);
    all.broken += one.broken;
  }
  return all;
}

}  // namespace

void inspect_before(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out) {
  const solid::MapQuality quality = inspect(rest, work);
  out.broken = quality.broken;
  out.min_det_f_before = out.min_det_f_after = quality.min_det_f;
  out.max_det_f_before = out.max_det_f_after = quality.max_det_f;
  out.clamped = out.rejected = 0;
  for (const solid::SolidWork& w : work) {
    out.clamped += w.degenerate;
    out.rejected += w.rejected;
  }
}

void inspect_after(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out) {
  const solid::MapQuality quality = inspect(rest, work);
  out.min_det_f_after = quality.min_det_f;
  out.max_det_f_after = quality.max_det_f;
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

TransportChange transport_change(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                                 const solid::SolidWork& work, const VolumeTarget& target,
                                 const solid::Momenta& before) {
  TransportChange change;
  if (!rest.compressible && state.whole) {
    change.volume_mesh = solid::volume_ratio(rest, state) - target.mesh;
    change.volume_cells = work.volume / state.rest_volume_cells - target.cells;
  }
  const solid::Momenta now = solid::measure_momenta(parallel, state.band, work, state.band.grid, state.v);
  change.momentum = now.linear - before.linear;
  change.angular_momentum = now.angular - before.angular;
  if (state.whole && work.counted_mass > 0.0)
    change.mass = work.counted_mass / (rest.density * state.rest_volume_cells) - 1.0;
  return change;
}

std::vector<TransportChange> transport_changes(const Parallel& parallel, const std::vector<solid::SolidRest>& rest,
                                               const SolidStates& states, const SolidWorks& work,
                                               const std::vector<VolumeTarget>& targets,
                                               const std::vector<solid::Momenta>& before) {
  std::vector<TransportChange> changes;
  for (std::size_t l = 0; l < before.size(); ++l)
    changes.push_back(transport_change(parallel, rest[l], states[l], work[l], targets[l], before[l]));
  return changes;
}

}  // namespace efsi::sim
