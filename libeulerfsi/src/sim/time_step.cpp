#include "sim/time_step.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::sim {
namespace {

// Largest dt with (speed + a dt) dt <= distance.
double time_to_move(double speed, double a, double distance) {
  if (a > 0.0) return 2.0 * distance / (speed + std::sqrt(speed * speed + 4.0 * a * distance));
  return speed > 0.0 ? distance / speed : std::numeric_limits<double>::infinity();
}

}  // namespace

double compute_time_step(const Params& params, const grid::Grid& g, const State& state, double remaining) {
  double limit = params.max_time_step > 0.0 ? std::min(params.max_time_step, remaining) : remaining;
  if (!state.solids.empty())
    limit = std::min(limit, time_to_move(state.solid_speed, params.gravity.norm(), params.cfl_solid * g.h));
  if (params.fluid.present) limit = std::min(limit, time_to_move(state.fluid_speed, 0.0, params.cfl_fluid * g.h));
  return remaining / std::ceil(remaining / limit - 1e-6);
}

}  // namespace efsi::sim
