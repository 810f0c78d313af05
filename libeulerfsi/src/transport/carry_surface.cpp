#include "transport/carry_surface.hpp"

#include "solid/surface/surface.hpp"

namespace efsi::sim {

void carry_surface(const StepContext& step, std::size_t l, const solid::RigidStep& frame,
                   const solid::AdvectWorkspace& packed, const solid::SolidWork& work, solid::SolidState& state) {
  const auto& [parallel, scene, time, dt, profile, info] = step;
  ScopedTimer timer(profile, Stage::kSurface);
  solid::predict_surface(parallel, dt, frame, packed, state);
  solid::correct_surface(parallel, scene.solids[l], work.max_stretch, state);
  solid::measure_leak(scene.solids[l], work, state);
  state.whole = solid::is_whole(scene.grid, scene.params.walls, state);
  timer.visited(state.surface.size(), sizeof(Vec3d));
}

}  // namespace efsi::sim
