#include "nodes/step_weight.hpp"

#include <algorithm>

namespace efsi::sim {

StepWeight weight_in_step(const Scene& scene, double dt, const SolidWorks& solids) {
  const fluid::FluidParams& fluid = scene.params.fluid;
  double ambient = fluid.present ? fluid.density : 0.0;
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    if (!is_collider(scene.pins, l) && solids[l].total_mass > 0.0)
      ambient = std::min(ambient, (1.0 + kMostLift) * scene.solids[l].density);
  const Vec3d kick = dt * scene.params.gravity;
  StepWeight weight;
  weight.fluid = ((fluid.present ? 1.0 - ambient / fluid.density : 0.0) * kick).cast<Real>();
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    const solid::SolidRest& rest = scene.solids[l];
    const double mass = solids[l].total_mass;
    const double density = rest.compressible && mass > 0.0 ? mass / solids[l].volume : rest.density;
    weight.solids.push_back(((1.0 - ambient / density) * kick).cast<Real>());
  }
  return weight;
}

}  // namespace efsi::sim
