#include "transport/left_box.hpp"

#include <algorithm>

#include "solid/element/mass.hpp"

namespace efsi::sim {
namespace {

// Over the nodes whose data are the solid's own, or where there are none over the next best.
Vec3 mean_velocity(const solid::SolidState& state) {
  std::uint8_t best = solid::kExtrapolated;
  for (const std::uint8_t mark : state.valid)
    if (mark != solid::kNoData) best = std::min(best, mark);
  Vec3d sum = Vec3d::Zero();
  std::size_t count = 0;
  for (std::size_t n = 0; n < state.valid.size(); ++n) {
    if (state.valid[n] != best) continue;
    sum += state.v.at(n).cast<double>();
    ++count;
  }
  return count > 0 ? Vec3((sum / static_cast<double>(count)).cast<Real>()) : Vec3(Vec3::Zero());
}

// A cell without data, which only the velocity fills.
void empty(solid::SolidState& state) {
  const Vec3 v = mean_velocity(state);
  state.band.grid.cells = {1, 1, 1};
  const std::size_t nodes = state.band.grid.node_count();
  state.u.assign(nodes);
  state.v.assign(nodes);
  state.change = {};
  for (std::size_t n = 0; n < nodes; ++n) state.v.set(n, v);
  state.valid.assign(nodes, solid::kNoData);
  state.stiff.clear();
  state.leak = 0.0;
}

}  // namespace

void remove_departed(const StepContext& step, SolidStates& states, SolidWorks& solids) {
  for (std::size_t l = 0; l < states.size(); ++l) {
    if (states[l].whole || !solids[l].element_cell.empty() || solid::has_left(states[l])) continue;
    empty(states[l]);
    solids[l].near_folds.clear();
    solids[l].fold_places = {};
    solid::compute_mass(step.parallel, step.scene.solids[l], states[l], solids[l]);
  }
}

void continue_motion(double dt, solid::SolidState& state) {
  const Vec3d way = dt * state.v.at(0).cast<double>();
  for (Vec3d& x : state.surface) x += way;
}

}  // namespace efsi::sim
