#include "solve/reactions.hpp"

#include "linalg/reduce.hpp"
#include "system/divergence.hpp"

namespace efsi::sim {
namespace {

Vec3 entries(const std::vector<Real>& x, std::size_t unknown) {
  return {x[3 * unknown], x[3 * unknown + 1], x[3 * unknown + 2]};
}

}  // namespace

Reaction velocity_reaction(const Parallel& parallel, VelocityEquation& elasticity, std::vector<Vec3d>& sums) {
  std::vector<Real> held;
  elasticity.system.multiply(parallel, elasticity.v_star, held);
  linalg::add_scaled(parallel, held, -1.0, elasticity.f_star);
  sums = elasticity.system.sum_by_solid(parallel, held);
  return [&system = elasticity.system, held = std::move(held)](std::size_t solid, std::size_t node) {
    return entries(held, system.unknown_of(solid, node));
  };
}

Reaction pressure_reaction(const Parallel& parallel, const grid::Grid& grid, const PressureEquation& pressure,
                           const system::SlipNodes& slip, VelocityEquation& elasticity) {
  const Real coupled = pressure.coupled;
  std::vector<Real> answer;
  if (coupled != 0) {
    elasticity.system.multiply(parallel, pressure.correction, answer);
    elasticity.system.add_penalty_impulses(1, pressure.answers, answer, true);
  }
  return [&grid, &pressure, &slip, &system = elasticity.system, coupled, answer = std::move(answer)](std::size_t solid,
                                                                                                     std::size_t node) {
    const auto [i, j, k] = grid.node_place(node);
    const std::size_t t = slip.find(solid, node);
    Vec3 impulse = t == system::SlipNodes::kNone ? system::pressure_impulse(grid, pressure.q, i, j, k)
                                                 : slip.solid_impulse(t, pressure.q);
    if (coupled != 0) impulse -= coupled * entries(answer, system.unknown_of(solid, node));
    return impulse;
  };
}

}  // namespace efsi::sim
