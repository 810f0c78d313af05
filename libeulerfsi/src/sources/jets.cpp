#include "sources/jets.hpp"

#include <algorithm>

namespace efsi::sim {

double fastest_jet(const Scene& scene, double time, double remaining) {
  double speed = 0.0;
  if (!scene.params.fluid.present) return speed;
  for (const fluid::Emitter& emitter : scene.emitters) speed = std::max(speed, emitter.fastest(time, time + remaining));
  return speed;
}

void add_jets(const StepContext& step, const Matter& matter, Jets& jets, std::vector<Real>& source) {
  const grid::Grid& g = matter.common.grid;
  jets.clear();
  step.info.jets.assign(step.scene.emitters.size(), 0.0);
  if (!step.scene.params.fluid.present || !step.scene.params.walls.any_open()) return;
  const Real fluid_volume = static_cast<Real>(1.0 / step.scene.params.fluid.density);
  for (std::size_t e = 0; e < step.scene.emitters.size(); ++e) {
    const fluid::Emitter& emitter = step.scene.emitters[e];
    if (!emitter.is_jet()) continue;
    const fluid::Emission emission = emitter.emission(step.time, step.dt);
    if (emission.share > 0.0)
      step.info.jets[e] = fluid::find_sources(g, emitter, emission, matter.fixed, matter.owned, matter.specific_volume,
                                              fluid_volume, jets);
  }
  if (jets.empty()) return;
  source.resize(g.padded_count(), 0);
  for (const fluid::SourceCell& cell : jets) source[g.padded(cell.place[0], cell.place[1], cell.place[2])] += cell.rate;
}

}  // namespace efsi::sim
