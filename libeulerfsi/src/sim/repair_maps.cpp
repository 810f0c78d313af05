#include "sim/repair_maps.hpp"

#include "solid/repair.hpp"

namespace efsi::sim {

void repair_maps(const StepContext& step, SolidStates& states, SolidWorks& solids) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  ScopedTimer timer(profile, Stage::kSolidMass);
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    info.degenerate_cells += solid::repair_map(parallel, scene.solids[l], states[l], solids[l]);
}

}  // namespace efsi::sim
