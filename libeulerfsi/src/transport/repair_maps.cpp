#include "transport/repair_maps.hpp"

#include <algorithm>

#include "solid/element/entering.hpp"
#include "solid/element/repair.hpp"

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

// det F after the repair.
void inspect_after(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out) {
  const solid::MapQuality quality = inspect(rest, work);
  out.min_det_f_after = quality.min_det_f;
  out.max_det_f_after = quality.max_det_f;
}

}  // namespace

void inspect_maps(const std::vector<solid::SolidRest>& rest, const SolidWorks& work, Repairs& out) {
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

void settle_entering(const StepContext& step, SolidStates& states, SolidWorks& solids) {
  ScopedTimer timer(step.profile, Stage::kSolidMass);
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l)
    solid::settle_entering(step.parallel, step.scene.solids[l], states[l], solids[l]);
}

void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids) {
  ScopedTimer timer(step.profile, Stage::kSolidMass);
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l)
    step.info.repairs.repaired_cells += solid::repair_map(step.parallel, step.scene.solids[l], states[l], solids[l]);
  if (step.info.repairs.repaired_cells == 0) return;
  step.info.degenerate_cells += step.info.repairs.repaired_cells;
  inspect_after(step.scene.solids, solids, step.info.repairs);
}

}  // namespace efsi::sim
