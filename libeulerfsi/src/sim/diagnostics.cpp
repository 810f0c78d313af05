// Purpose: diagnostics of the state: solids, fluid, memory.
#include <algorithm>
#include <limits>

#include "base/byte_count.hpp"
#include "sim/simulation.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_force.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/momentum.hpp"
#include "solid/surface/surface.hpp"

namespace efsi::sim {

SolidDiagnostics Simulation::diagnose_solid(std::size_t index) {
  const solid::SolidRest& rest = solids_[index];
  const solid::SolidState& state = state_.solids[index];
  solid::SolidWork& work = work_.solids[index];
  solid::compute_mass(parallel_, rest, state, work);
  solid::compute_material(parallel_, rest, state, params_.numerics.points_per_element, work);

  SolidDiagnostics d;
  const solid::Momenta momenta = solid::measure_momenta(parallel_, state.band, work, state.band.grid, state.v);
  d.mass = momenta.mass;
  d.center = momenta.center;
  d.momentum = momenta.linear;
  d.angular_momentum = momenta.angular;
  d.kinetic_energy = momenta.kinetic_energy;
  d.elastic_energy = work.elastic_energy;
  d.rest_volume = rest.volume;
  d.rest_volume_cells = state.rest_volume_cells;
  d.volume_cells = work.volume;
  d.volume_mesh = rest.volume * solid::volume_ratio(rest, state);
  d.extent_min.setConstant(std::numeric_limits<double>::infinity());
  d.extent_max = -d.extent_min;
  for (const Vec3d& x : state.surface) {
    d.extent_min = d.extent_min.cwiseMin(x);
    d.extent_max = d.extent_max.cwiseMax(x);
  }
  d.min_det_f = work.min_det_f;
  d.max_det_f = work.max_det_f;
  d.max_stretch = work.max_stretch;
  d.false_edges = solid::count_false_edges(rest, state, work.max_stretch);
  d.elements = work.element_cell.size();
  d.memory_bytes = work.bytes() + solid::state_bytes(state);
  d.max_plastic_strain = solid::largest_plastic_strain(state);
  return d;
}

FluidDiagnostics Simulation::diagnose_fluid() {
  prepare();
  FluidDiagnostics d;
  if (!params_.fluid.present) return d;
  const std::vector<Real>& fraction = solid_fraction();
  struct Sums {
    double energy = 0.0, carried = 0.0, smoke = 0.0, speed = 0.0, divergence = 0.0;
    Vec3d momentum = Vec3d::Zero();
  };
  const grid::VectorField& velocity = fluid_velocity();
  const grid::VectorField& ahead = state_.fluid.velocity;  // with the carried pressure
  const double h3 = grid_.h * grid_.h * grid_.h;
  const auto corner = grid::corner_offsets(grid_);
  std::vector<Sums> planes(static_cast<std::size_t>(grid_.cells[2]));
  parallel_.for_each(grid_.cells[2], [&](std::int64_t kk) {
    Sums& s = planes[static_cast<std::size_t>(kk)];
    const int k = static_cast<int>(kk);
    for (int j = 0; j < grid_.cells[1]; ++j)
      for (int i = 0; i < grid_.cells[0]; ++i) {
        const std::size_t c = grid_.cell(i, j, k), n = grid_.node(i, j, k);
        const double part = fraction.empty() ? 1.0 : 1.0 - static_cast<double>(fraction[c]);
        if (!state_.fluid.smoke.empty()) s.smoke += h3 * static_cast<double>(state_.fluid.smoke[c]);
        double divergence = 0.0;
        for (std::size_t a = 0; a < 8; ++a) {
          const Vec3d v = velocity.at(n + corner[a]).cast<double>();
          const double m = params_.fluid.density * h3 * part / 8.0;
          s.energy += 0.5 * m * v.squaredNorm();
          s.carried += 0.5 * m * (ahead.at(n + corner[a]).cast<double>().squaredNorm() - v.squaredNorm());
          s.momentum += m * v;
          s.speed = std::max(s.speed, part > 0.0 ? v.norm() : 0.0);
          for (int x = 0; x < 3; ++x) divergence += (grid::kCorner[a][x] ? v[x] : -v[x]) / (4.0 * grid_.h);
        }
        if (part == 1.0) s.divergence = std::max(s.divergence, std::abs(divergence));
      }
  });
  for (const Sums& s : planes) {
    d.kinetic_energy += s.energy;
    d.carried_energy += s.carried;
    d.momentum += s.momentum;
    d.smoke += s.smoke;
    d.max_speed = std::max(d.max_speed, s.speed);
    d.max_divergence = std::max(d.max_divergence, s.divergence);
  }
  return d;
}

std::uint64_t Simulation::memory_bytes() const {
  const Matter& matter = work_.matter;
  const VelocityEquation& elasticity = work_.elasticity;
  const PressureEquation& pressure = work_.pressure;
  ByteCount count;
  visit_fields(state_, count);
  visit_fields(work_.backup, count);
  for (const auto* field : {&work_.velocity.field, &work_.before_forces.field, &box_.velocity})
    for (const auto& c : field->c) count.array(c);
  for (const auto* values :
       {&matter.fluid_mass, &matter.mass, &matter.specific_volume, &matter.cell_fraction, &elasticity.f_star,
        &elasticity.v_star, &elasticity.momentum, &pressure.source, &pressure.compliance, &pressure.q, &pressure.taken,
        &pressure.impulse, &pressure.correction, &pressure.corrected, &pressure.direction, &pressure.left,
        &box_.fraction, &box_.pressure})
    count.array(*values);
  count.array(matter.fixed);
  count.array(matter.owned);
  std::uint64_t sum = count.bytes + work_.velocity.slip.bytes() + elasticity.system.bytes() + pressure.system.bytes() +
                      work_.advect.bytes() + work_.solid_advect.bytes() + work_.viscous.bytes();
  for (const auto& solid : work_.solids) sum += solid.bytes();
  for (const auto& particles : work_.particles) sum += particles.bytes();
  for (const auto& solid : solids_) sum += solid.nearest.bytes() + solid.thin.bytes();
  for (const auto& solid : state_.solids)
    if (solid.shape) sum += solid.shape->bytes();
  for (const fluid::Emitter& emitter : emitters_) sum += emitter.bytes();
  return sum;
}

}  // namespace efsi::sim
