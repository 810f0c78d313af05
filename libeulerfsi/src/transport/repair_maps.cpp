#include "transport/repair_maps.hpp"

#include "solid/element/repair.hpp"

namespace efsi::sim {

void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  ScopedTimer timer(profile, Stage::kSolidMass);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    info.repairs.put_back += solid::repair_map(parallel, scene.solids[l], states[l], solids[l]);
  if (info.repairs.put_back == 0) return;
  info.degenerate_cells += info.repairs.put_back;
  inspect_after(scene.solids, solids, info.repairs);
}

}  // namespace efsi::sim
