#include "sim/step_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "solid/element/energy.hpp"

namespace efsi::sim {
namespace {

constexpr double kContactFall = 3.0;  // cells: the energy of a fall that need not be kept
constexpr double kAim = 1.15;         // times step_tolerance: of a solid's energy, while a wave passes it
constexpr double kErrs = 1.6;         // times that, in one step: it is repeated
constexpr double kGrowth = 2.0;       // of one step after another
constexpr double kCreep = 0.01;       // cells: what moves less in a step does not err

// v.K v of a solid [J/s^2]: its implicit stiffness takes up to dt^2 of it in a step of dt in which v strains its map.
double v_k_v(const solid::CellMotion& motion) {
  return motion.volume > 0.0 ? motion.root * motion.root / motion.volume : 0.0;
}

// Its kinetic energy and that of a fall that need not be kept [J].
double moving_energy(const Scene& scene, const solid::SolidRest& rest, const solid::CellMotion& motion, bool touches) {
  const double fall = touches ? kContactFall * scene.params.gravity.norm() * scene.grid.h : 0.0;
  return rest.density * (motion.half_square + fall * motion.volume);
}

// Time in which a shear wave passes a solid [s].
double wave_pass(const solid::SolidRest& rest) {
  return std::cbrt(rest.volume) / std::sqrt(rest.elastic.mu / rest.density);
}

// In which nothing moves that could err; speed: the largest of a solid [m/s] [s].
double creeping_step(const Scene& scene, double speed) { return kCreep * scene.grid.h / speed; }

}  // namespace

double resolved_step(const Scene& scene, const solid::SolidRest& rest) {
  const double pace = std::max(kContactPace * scene.grid.h / std::cbrt(rest.volume), kContactShare);
  return scene.params.numerics.step_tolerance / kNormalTolerance * pace * wave_pass(rest);
}

double longest_step(const Parallel& parallel, const Scene& scene, const solid::SolidRest& rest,
                    const solid::SolidState& solid, bool touches) {
  const double resolved = resolved_step(scene, rest);
  if (solid.by_loss.holds()) return std::max(resolved, solid.by_loss.step);
  const solid::CellMotion motion = solid::measure_motion(parallel, rest, solid);
  const double energy = moving_energy(scene, rest, motion, touches), rate = v_k_v(motion);
  if (!(rate > 0.0)) return std::numeric_limits<double>::infinity();
  const double expected = kAim * scene.params.numerics.step_tolerance * energy / (wave_pass(rest) * rate);
  return std::max({resolved, creeping_step(scene, solid.speed), expected});
}

void measure_straining(const StepContext& step, const SolidStates& states, SolidWorks& solids) {
  for (std::size_t l = 0; l < solids.size(); ++l) {
    solids[l].straining = {};
    if (!solids[l].keeps_energy) continue;
    ScopedTimer timer(step.profile, Stage::kCheck);
    solids[l].straining = solid::measure_motion(step.parallel, step.scene.solids[l], states[l]);
  }
}

bool keep_energy(const Parallel& parallel, const Scene& scene, double dt, const SolidWorks& solids, SolidStates& before,
                 SolidStates& after) {
  const Numerics& numerics = scene.params.numerics;
  const double aim = kAim * numerics.step_tolerance;
  bool repeat = false;
  for (std::size_t l = 0; l < solids.size(); ++l) {
    after[l].by_loss = {};
    const double loss = dt * dt * v_k_v(solids[l].straining);
    if (!(loss > 0.0) || solid::has_left(after[l])) continue;
    const solid::SolidRest& rest = scene.solids[l];
    const double pass = wave_pass(rest), resolved = resolved_step(scene, rest);
    const double calm = std::max(resolved, creeping_step(scene, std::max(before[l].speed, after[l].speed)));
    double energy =
        moving_energy(scene, rest, solids[l].straining, solids[l].touches) + loss;  // that at the start of the step
    const auto errs = [&] { return dt > calm && loss > kErrs * aim * energy; };
    const auto longest = [&] { return std::max(resolved, aim * std::min(1.0, dt / pass) * energy / loss * dt); };
    const double growth = kGrowth * std::max(dt, calm);
    if (errs() || longest() < growth)  // what is stored counts, too
      energy += solid::elastic_energy(parallel, rest, after[l], solids[l], numerics.points_per_element);
    if (errs()) {
      repeat = true;
      before[l].by_loss.step = longest();
    } else {
      after[l].by_loss.step = std::min(longest(), growth);
    }
  }
  return repeat;
}

}  // namespace efsi::sim
