#include "transport/carry_surface.hpp"

#include "solid/surface/surface.hpp"

namespace efsi::sim {

void carry_surface(const StepContext& step, std::size_t l, const solid::BodyStep& frame,
                   const solid::AdvectWorkspace& packed, const solid::SolidWork& work, solid::SolidState& state) {
  ScopedTimer timer(step.profile, Stage::kSurface);
  solid::predict_surface(step.parallel, step.dt, frame, packed, state);
  const Eigen::AlignedBox3d reach = solid::map_reach(step.scene.grid, step.scene.params.walls);
  solid::correct_surface(step.parallel, reach, step.scene.solids[l], work.max_stretch, state);
  solid::measure_leak(step.scene.solids[l], work, state);
  state.whole = solid::is_whole(step.scene.grid, step.scene.params.walls, state);
  timer.visited(state.surface.size(), sizeof(Vec3d));
}

}  // namespace efsi::sim
