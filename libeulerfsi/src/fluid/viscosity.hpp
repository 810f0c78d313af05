// Purpose: what viscosity does to the velocity in a step, implicitly (docs/numerics/viscosity.md).
// Backward Euler, first order in the step: (M + dt K) v = M v_before with the viscous stiffness K of the cells that are
// fluid,  v.K v = mu int |grad v|^2 + grad v : (grad v)^T = 2 mu int e : e,  e the symmetric part of grad v. Trilinear
// cells; the second term by the mean gradient of a cell, whose trace is the divergence that the pressure removes. K
// does nothing to a rigid motion, and what the fluid loses of its momentum solids and walls gain.
#pragma once

#include <cstdint>
#include <vector>

#include "grid/grid.hpp"
#include "linalg/pcg.hpp"

namespace efsi::fluid {

struct ViscousWorkspace {
  std::vector<Real> mass, inverse_diagonal, x, b;  // entries: component by component, nodes
  linalg::PcgWorkspace pcg;
  std::size_t bytes() const {
    return (mass.size() + inverse_diagonal.size() + x.size() + b.size()) * sizeof(Real) + pcg.bytes();
  }
};

// work.mass: per node [kg]; 0: there is nothing to move, the velocity stays. fixed: per node, bit a: component a is
// given. solid: padded cells, 0 where there is fluid; empty: everywhere. viscosity: mu [Pa s].
linalg::SolveStats diffuse(const Parallel& parallel, const grid::Grid& g, const std::vector<std::uint8_t>& fixed,
                           const std::vector<std::uint8_t>& solid, double viscosity, double dt,
                           grid::VectorField& velocity, ViscousWorkspace& work);

// y = K x for mu = 1 and h = 1, of whole fields; used by tests.
void viscous_force(const Parallel& parallel, const grid::Grid& g, const std::vector<std::uint8_t>& solid,
                   const std::vector<Real>& x, std::vector<Real>& y);

}  // namespace efsi::fluid
