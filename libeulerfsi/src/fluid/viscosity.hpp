// Purpose: what viscosity does to the velocity in a step, implicitly (docs/numerics/viscosity.md).
// Backward Euler, (M + dt K) v = M v_before, in one step and in two of half the length, extrapolated to second order,
// with the viscous stiffness K of the cells that are fluid,  v.K v = mu int |grad v|^2 + grad v : (grad v)^T = 2 mu int
// e : e,  e the symmetric part of grad v. Trilinear cells; the second term by the mean gradient of a cell, whose trace
// is the divergence that the pressure removes. K does nothing to a rigid motion, and what the fluid loses of its
// momentum solids and walls gain.
#pragma once

#include <cstdint>
#include <vector>

#include "grid/grid.hpp"
#include "linalg/pcg.hpp"

namespace efsi::fluid {

struct ViscousWorkspace {
  std::vector<Real> mass;                                                // nodes
  std::vector<Real> inverse_diagonal, x, b, half, right, whole, forces;  // entries: component by component, nodes
  linalg::PcgWorkspace pcg;
  std::size_t bytes() const {
    return (mass.size() + inverse_diagonal.size() + x.size() + b.size() + half.size() + right.size() + whole.size() +
            forces.size()) *
               sizeof(Real) +
           pcg.bytes();
  }
};

// Solids that respond within the step: without viscosity M x + S x = r, S symmetric and positive semi-definite, on the
// entries of the field and on more behind them, velocities of solids that the field does not have.
struct SolidResponse {
  std::vector<Real> mass;      // of the entries behind the field's [kg]
  std::vector<Real> diagonal;  // of S, of all entries [kg]
  std::vector<Real> internal;  // r less the impulse of forces on the field, of all entries [kg m/s]
  linalg::Operator add;        // y += S x
  linalg::Operator correct;    // z += what a preconditioner has of S^-1 r beside the diagonal
};

struct ViscousStep {
  const std::vector<std::uint8_t>& fixed;  // per node, bit a: component a is given
  const std::vector<std::uint8_t>& solid;  // padded cells, 0 where there is fluid; empty: everywhere
  double viscosity, dt;                    // mu [Pa s], [s]
  const grid::VectorField& before;         // the velocity before the forces of the step, which act during the diffusion
  // Those in which elasticity responds, so that with the response the velocity would be before + work.x; null: none.
  const SolidResponse* solids = nullptr;
  bool reactions = false;  // work.right becomes the impulse of viscosity on what is given [kg m/s]
};

// velocity: that with the forces of the step becomes that with the impulse of viscosity, too. work.mass: per node [kg];
// 0: there is nothing to move, the velocity stays.
linalg::SolveStats diffuse(const Parallel& parallel, const grid::Grid& g, const ViscousStep& step,
                           grid::VectorField& velocity, ViscousWorkspace& work);

// y = K x for mu = 1 and h = 1, of whole fields; used by tests.
void viscous_force(const Parallel& parallel, const grid::Grid& g, const std::vector<std::uint8_t>& solid,
                   const std::vector<Real>& x, std::vector<Real>& y);

}  // namespace efsi::fluid
