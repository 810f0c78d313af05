#include "sim/step_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "solid/element/energy.hpp"

namespace efsi::sim {
namespace {

constexpr double kContactFall = 3.0;  // cells: the energy of a fall that need not be kept
constexpr double kErrs = 2.0;         // times step_tolerance: the part of its energy of which one step takes too much
constexpr double kGrowth = 2.0;       // of the steps after such a one
constexpr double kCreep = 0.02;       // cells: what moves less in a step does not err

}  // namespace

ShearWaves shear_waves(const Scene& scene, const solid::SolidRest& rest) {
  const double size = std::cbrt(rest.volume), pass = size / std::sqrt(rest.elastic.mu / rest.density);
  const double resolved = scene.params.numerics.step_tolerance / kNormalTolerance * pass *
                          std::max(kContactPace * scene.grid.h / size, kContactShare);
  return {pass, resolved};
}

double v_k_v(const solid::CellMotion& motion) {
  return motion.volume > 0.0 ? motion.root * motion.root / motion.volume : 0.0;
}

double moving_energy(const Scene& scene, const solid::SolidRest& rest, const solid::CellMotion& motion) {
  const double fall = kContactFall * scene.params.gravity.norm() * scene.grid.h;
  return rest.density * (motion.half_square + fall * motion.volume);
}

void measure_straining(const StepContext& step, const SolidStates& states, SolidWorks& solids) {
  for (std::size_t l = 0; l < solids.size(); ++l) {
    solids[l].straining = {};
    const bool coarse = step.dt > shear_waves(step.scene, step.scene.solids[l]).resolved;
    if (!solids[l].keeps_energy || (!coarse && !states[l].by_loss.holds())) continue;
    ScopedTimer timer(step.profile, Stage::kCheck);
    solids[l].straining = solid::measure_motion(step.parallel, step.scene.solids[l], states[l]);
  }
}

bool keep_energy(const Parallel& parallel, const Scene& scene, double dt, const SolidWorks& solids, SolidStates& before,
                 SolidStates& after) {
  bool errs = false;
  for (std::size_t l = 0; l < solids.size(); ++l) {
    after[l].by_loss = {};
    const double loss = dt * dt * v_k_v(solids[l].straining);
    if (!(loss > 0.0) || solid::has_left(after[l])) continue;
    const solid::SolidRest& rest = scene.solids[l];
    const double tolerance = scene.params.numerics.step_tolerance;
    double energy = moving_energy(scene, rest, solids[l].straining) + loss;  // that at the start of the step
    const bool moves = dt * std::max(before[l].speed, after[l].speed) > kCreep * scene.grid.h;
    const auto too_much = [&] { return moves && loss > kErrs * tolerance * energy; };
    if (!before[l].by_loss.holds() && !too_much()) continue;
    energy += solid::elastic_energy(parallel, rest, after[l], solids[l], scene.params.numerics.points_per_element);
    const ShearWaves waves = shear_waves(scene, rest);
    const double longest = std::max(waves.resolved, tolerance * std::min(1.0, dt / waves.pass) * energy / loss * dt);
    if (dt > waves.resolved && too_much()) {
      errs = true;
      before[l].by_loss.step = longest;
    } else if (before[l].by_loss.holds()) {
      after[l].by_loss.step = std::min(longest, kGrowth * dt);
    }
  }
  return errs;
}

}  // namespace efsi::sim
