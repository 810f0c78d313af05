// Purpose: slow twin of the velocity update: one solid in vacuum, its elastic force integrated explicitly as in
// Eulerian Solids (Levin et al. 2011), v* = v + dt M^-1 f, or implicitly by Eq. 8. All else is the same: lines 3, 4,
// 13, 18 to 20 of Algorithm 1, no pressure.
#pragma once

#include <cmath>

#include "solid/map/displacement.hpp"
#include "solid/momentum.hpp"
#include "solid/particles/particles.hpp"
#include "system/velocity_system.hpp"
#include "unit/solid/ball.hpp"

namespace efsi::reference {

enum class Integration { kExplicit, kImplicit };

struct FreeSolid {
  test::TestSolid s;  // its band is the whole grid
  std::uint64_t steps = 0;
  double energy = 0.0;  // of the last step's start [J]

  // Solid cells at the start of the last step; 0: it is gone.
  std::size_t elements() const { return s.work.element_cell.size(); }

  void step(double dt, Integration integration) {
    const Parallel parallel(1);
    const grid::Grid& g = s.global;
    test::compute(s, 8);
    if (elements() == 0) return;
    const std::vector<std::uint8_t> fixed(g.node_count(), 0);
    const std::vector<system::SolidRef> refs = {{&s.rest, &s.state, &s.work, {1.0, 0.0}, {1.0, 0.0}, {1.0, 0.0}}};
    system::SlipNodes slip;
    system::VelocitySystem system;
    system.assemble(parallel, g, fixed, refs, s.work.mass, slip, dt);
    std::vector<Real> v, force, momentum;
    system.gather(parallel, s.state.v, slip, v);
    system.internal_force(parallel, force);
    system.multiply_mass(parallel, v, momentum);
    energy = s.work.elastic_energy;
    for (std::size_t i = 0; i < v.size(); ++i) {
      const Real mass = s.work.mass[system.nodes()[i / 3]];
      energy += 0.5 * static_cast<double>(momentum[i]) * static_cast<double>(v[i]);
      momentum[i] += static_cast<Real>(dt) * force[i];
      if (integration == Integration::kExplicit) v[i] = momentum[i] / mass;
    }
    if (integration == Integration::kImplicit) system.solve(parallel, system::VelocitySolver::kPcr, momentum, v, 1e-3);
    grid::VectorField field = s.state.v;
    system.scatter(parallel, v, field, slip);
    solid::take_velocity(parallel, g, 0.0, field, s.state, s.work);
    solid::extend(parallel, s.rest, s.state, s.work);
    solid::Particles particles;
    solid::seed_particles(parallel, s.rest, s.state, s.work, steps, particles);
    solid::rasterize(parallel, dt, s.rest, particles, s.state, s.work);
    solid::AdvectWorkspace packed;
    solid::advect(parallel, solid::AdvectionScheme::kPaper, dt, {}, s.work, s.state, packed);
    ++steps;
  }
};

}  // namespace efsi::reference
