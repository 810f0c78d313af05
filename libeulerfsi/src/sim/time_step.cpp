#include "sim/time_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace efsi::sim {
namespace {

constexpr double kContactCfl = 1.0;       // cells per step in contact
constexpr double kContactDistance = 1.0;  // cells: 2 less what a step in contact moves

// Largest dt with (speed + a dt) dt <= distance.
double time_to_move(double speed, double a, double distance) {
  if (a > 0.0) return 2.0 * distance / (speed + std::sqrt(speed * speed + 4.0 * a * distance));
  return speed > 0.0 ? distance / speed : std::numeric_limits<double>::infinity();
}

// Cells that a solid may move: fewer when its surface is about to reach a wall (Sec. 5.2 uses 0.6 for solids less than
// 2 cells apart).
double solid_cfl(const Params& params, const grid::Grid& g, const solid::SolidState& solid) {
  Vec3d low = Vec3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Vec3d& x : solid.surface) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  double gap = std::numeric_limits<double>::infinity();  // cells
  for (int a = 0; a < 3; ++a) {
    const double top = g.origin[a] + g.h * g.cells[static_cast<std::size_t>(a)];
    if (grid::Walls::blocks(params.walls.lower(a))) gap = std::min(gap, (low[a] - g.origin[a]) / g.h);
    if (grid::Walls::blocks(params.walls.upper(a))) gap = std::min(gap, (top - high[a]) / g.h);
  }
  return std::min(params.cfl_solid, std::max(kContactCfl, gap - kContactDistance));
}

}  // namespace

double compute_time_step(const Params& params, const grid::Grid& g, const State& state, double remaining) {
  double limit = params.max_time_step > 0.0 ? std::min(params.max_time_step, remaining) : remaining;
  for (const solid::SolidState& solid : state.solids)
    limit = std::min(limit, time_to_move(state.solid_speed, params.gravity.norm(), solid_cfl(params, g, solid) * g.h));
  if (params.fluid.present) limit = std::min(limit, time_to_move(state.fluid_speed, 0.0, params.cfl_fluid * g.h));
  return remaining / std::ceil(remaining / limit - 1e-6);
}

}  // namespace efsi::sim
