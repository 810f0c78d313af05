#include "sim/step_record.hpp"

#include <algorithm>

#include "solid/surface.hpp"

namespace efsi::sim {
namespace {

// The quality of all solids' maps as one.
solid::MapQuality inspect(const std::vector<solid::SolidRest>& rest, const std::vector<solid::SolidWork>& work) {
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

void inspect_before(const std::vector<solid::SolidRest>& rest, const std::vector<solid::SolidWork>& work,
                    Repairs& out) {
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

void inspect_after(const std::vector<solid::SolidRest>& rest, const std::vector<solid::SolidWork>& work, Repairs& out) {
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
  return change;
}

}  // namespace efsi::sim
