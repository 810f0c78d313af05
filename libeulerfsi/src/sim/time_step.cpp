#include "sim/time_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "grid/interpolate.hpp"

namespace efsi::sim {
namespace {

constexpr double kContactCfl = 0.4;       // cells per step in contact
constexpr double kContactReach = 2.0;     // cells
constexpr double kContactDistance = 1.0;  // cells: 2 less what a step in contact moves

// Largest dt with (speed + a dt) dt <= distance.
double time_to_move(double speed, double a, double distance) {
  if (a > 0.0) return 2.0 * distance / (speed + std::sqrt(speed * speed + 4.0 * a * distance));
  return speed > 0.0 ? distance / speed : std::numeric_limits<double>::infinity();
}

// What walls near a solid allow: its surface may reach them, or move by kContactCfl in contact (Sec. 5.2 uses 0.6 for
// solids less than 2 cells apart). Sliding along a wall is free.
double wall_limit(const Params& params, const grid::Grid& g, const solid::SolidState& solid) {
  const grid::NodeSampler sampler(solid.band.grid);
  double gap[6], closing[6] = {};  // cells; speed towards the wall of what is near it [m/s]
  std::fill(gap, gap + 6, std::numeric_limits<double>::infinity());
  for (const Vec3d& x : solid.surface)
    for (std::size_t face = 0; face < 6; ++face) {
      if (!grid::Walls::blocks(params.walls.face[face])) continue;
      const std::size_t axis = face / 2;
      const double at = (x[static_cast<Eigen::Index>(axis)] - g.origin[static_cast<Eigen::Index>(axis)]) / g.h;
      const double distance = face % 2 ? g.cells[axis] - at : at;
      gap[face] = std::min(gap[face], distance);
      if (distance > kContactReach) continue;
      const Vec3 local = ((x - solid.band.grid.origin) / g.h).cast<Real>();
      const double v = static_cast<double>(sampler.vector(solid.v, local)[static_cast<Eigen::Index>(axis)]);
      closing[face] = std::max(closing[face], face % 2 ? v : -v);
    }
  double limit = std::numeric_limits<double>::infinity();
  for (std::size_t face = 0; face < 6; ++face) {
    const double cells = std::max(kContactCfl, gap[face] - kContactDistance);
    if (cells < params.cfl_solid)
      limit = std::min(limit, time_to_move(closing[face], params.gravity.norm(), cells * g.h));
  }
  return limit;
}

}  // namespace

double compute_time_step(const Params& params, const grid::Grid& g, const State& state, double remaining) {
  double limit = params.max_time_step > 0.0 ? std::min(params.max_time_step, remaining) : remaining;
  for (const solid::SolidState& solid : state.solids) limit = std::min(limit, wall_limit(params, g, solid));
  if (!state.solids.empty())
    limit = std::min(limit, time_to_move(state.solid_speed, params.gravity.norm(), params.cfl_solid * g.h));
  if (params.fluid.present) limit = std::min(limit, time_to_move(state.fluid_speed, 0.0, params.cfl_fluid * g.h));
  return remaining / std::ceil(remaining / limit - 1e-6);
}

}  // namespace efsi::sim
