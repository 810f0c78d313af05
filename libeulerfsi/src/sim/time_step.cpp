#include "sim/time_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "grid/interpolate.hpp"
#include "solid/displacement.hpp"

namespace efsi::sim {
namespace {

constexpr double kContactCfl = 0.4;       // cells per step in contact
constexpr double kContactReach = 2.0;     // cells
constexpr double kContactDistance = 1.0;  // cells: 2 less what a step in contact moves
constexpr double kContactPace = 0.7;      // cells that a shear wave passes in a step in contact
constexpr double kContactStrain = 0.1;    // in a step in contact, below which waves need not be resolved

// Largest dt with (speed + a dt) dt <= distance.
double time_to_move(double speed, double a, double distance) {
  if (a > 0.0) return 2.0 * distance / (speed + std::sqrt(speed * speed + 4.0 * a * distance));
  return speed > 0.0 ? distance / speed : std::numeric_limits<double>::infinity();
}

// `limit`, or less: a step in which shear waves pass kContactPace cells, or more where that strains the solid little.
// While a solid is pressed flat against a wall nothing moves fast, and in long steps, which are damped, it would lose
// what it stores.
double wave_limit(const Parallel& parallel, const grid::Grid& g, const solid::SolidRest& rest,
                  const solid::SolidState& solid, double limit) {
  const double wave = kContactPace * g.h / std::sqrt(rest.elastic.mu / rest.density);
  if (limit <= wave) return limit;
  const double rate = solid::largest_strain_rate(parallel, solid, solid.valid);
  return std::min(limit, std::max(wave, rate > 0.0 ? kContactStrain / rate : limit));
}

// What walls near a solid allow: its surface may reach them, or move by kContactCfl in contact (Sec. 5.2 uses 0.6 for
// solids less than 2 cells apart). Sliding along a wall is free.
double wall_limit(const Parallel& parallel, const Scene& scene, std::size_t l, const solid::SolidState& solid) {
  const Params& params = scene.params;
  const grid::Grid& g = scene.grid;
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
  if (params.numerics.resolve_impacts && *std::min_element(gap, gap + 6) < kContactReach)
    limit = wave_limit(parallel, g, scene.solids[l], solid, limit);
  return limit;
}

}  // namespace

double compute_time_step(const Parallel& parallel, const Scene& scene, const State& state, double remaining) {
  const Params& params = scene.params;
  const grid::Grid& g = scene.grid;
  double limit = params.max_time_step > 0.0 ? std::min(params.max_time_step, remaining) : remaining;
  for (std::size_t l = 0; l < scene.solids.size(); ++l)
    limit = std::min(limit, wall_limit(parallel, scene, l, state.solids[l]));
  if (!state.solids.empty())
    limit = std::min(limit, time_to_move(state.solid_speed, params.gravity.norm(), params.cfl_solid * g.h));
  if (params.fluid.present) limit = std::min(limit, time_to_move(state.fluid_speed, 0.0, params.cfl_fluid * g.h));
  return remaining / std::ceil(remaining / limit - 1e-6);
}

}  // namespace efsi::sim
