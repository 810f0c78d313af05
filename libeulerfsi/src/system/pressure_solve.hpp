// Purpose: pressure and projection.
// Paper: Alg. 1 lines 10, 11; Sec. 4.5, Eq. 12:  J M^-1 J^T p = J v* - b.
// Unknown is the multiplier q [Pa s] with v = v* - M^-1 J^T q; the physical pressure is p = -q/dt, since J^T is minus
// the gradient. Compliant cells add a diagonal: J M^-1 J^T + D.
#pragma once

#include <array>
#include <vector>

#include "linalg/pcg.hpp"
#include "linalg/pcr.hpp"
#include "system/pressure_multigrid.hpp"
#include "system/sealed_parts.hpp"

namespace efsi::system {

enum class PressureSolver : std::int32_t { kMultigridPcg = 0, kPcr = 1 };

struct DivergenceNorms {
  double all = 0.0, solid = 0.0;  // 2-norm of div v over cells [1/s]
};

class PressureSystem {
 public:
  // specific_volume: 1/density per node, 0 where nothing moves [m^3/kg]; active: cells with an equation, empty: all.
  // solid_cell: padded cells owned by solids, may be empty; the tolerance is demanded of them by themselves, too.
  // given: nodes may have prescribed motion, without W. fixed: per node, components that walls fix. slip: nodes with
  // two velocities, or none; used until the next call. sticks: the fluid slips along no solid. compliance: D per padded
  // cell [m^4/kg], its compliance; empty: none.
  void assemble(const Parallel& parallel, const Grid& g, const Walls& walls, const std::vector<std::uint8_t>& fixed,
                const std::vector<Real>& specific_volume, std::vector<std::uint8_t> active,
                std::vector<std::uint8_t> solid_cell, SlipNodes* slip = nullptr, bool given = false,
                bool sticks = false, const std::vector<Real>& compliance = {});
  // What the next solve has on the right: h^3 (J v - source), in a closed box, or a closed part of it, less its mean.
  // source: wanted div v per padded cell [1/s], may be empty.
  DivergenceNorms set_right_side(const Parallel& parallel, const VectorField& velocity,
                                 const std::vector<Real>& source);
  const std::vector<Real>& right_side() const { return rhs_; }  // padded cells [m^3/s]
  // Solves for q. It holds a guess, which multigrid takes only where it helps. tolerance: with multigrid of `before`,
  // otherwise of the right-hand side.
  linalg::SolveStats solve(const Parallel& parallel, PressureSolver solver, double tolerance,
                           const DivergenceNorms& before, std::vector<Real>& q);
  // The same from zero and by multigrid, up to the part `tolerance` of the right-hand side.
  linalg::SolveStats estimate(const Parallel& parallel, double tolerance, std::vector<Real>& q);
  // How far along q to go, by conjugate gradients; velocity: where all of q led from that of the estimate.
  double step_length(const Parallel& parallel, const VectorField& velocity, const std::vector<Real>& source,
                     const std::vector<Real>& q);
  // v -= M^-1 J^T q
  void project(const Parallel& parallel, std::vector<Real>& q, VectorField& velocity);
  DivergenceNorms norms(const Parallel& parallel, const VectorField& velocity, const std::vector<Real>& source);
  // One of its arrays for padded cells, whose values mean nothing between solves.
  std::vector<Real>& scratch() { return pcg_.z; }
  // Exchanges five arrays for five of these; a second call takes them back.
  void exchange_scratch(const std::array<std::vector<Real>*, 5>& arrays);
  std::size_t bytes() const;

 private:
  bool closed() const;
  void find_parts(const Parallel& parallel);  // where motion may be prescribed
  // Of the right-hand side: the part out of reach of any pressure, which would act on no free node. Where the fluid
  // sticks to the walls along two axes a pressure that alternates along both, cell by cell, and is what it likes along
  // the third, does not. Fluxes of nodes that move have nothing of it, those of walls that move and sources may have.
  void subtract_alternating(const Parallel& parallel);
  // In one layer of cells normal to an axis, along the two others.
  void subtract_alternating(std::size_t axis, int layer, const std::vector<std::uint8_t>& active);
  // Of the right-hand side, in a closed box or its closed parts: what flows in, which no pressure can take.
  void subtract_means(const Parallel& parallel);
  void compute_residual(const Parallel& parallel, const VectorField& velocity, const std::vector<Real>& source,
                        std::vector<Real>& r);
  double solid_norm(const Parallel& parallel, const std::vector<Real>& r) const;  // of the solids' cells
  DivergenceNorms residual_norms(const Parallel& parallel, const std::vector<Real>& r) const;
  linalg::Operator operator_of(const Parallel& parallel);
  // From q, which leaves pcg_.r.
  linalg::SolveStats solve_multigrid(const Parallel& parallel, const linalg::SolveOptions& options,
                                     std::vector<Real>& q);
  // Keeps q where it leaves a smaller residual than zero does, which it becomes otherwise; pcg_.r: what is left.
  bool keep_last(const Parallel& parallel, std::vector<Real>& q);
  Grid grid_;
  Walls walls_;
  std::vector<std::size_t> solid_cells_;  // padded, in order
  std::vector<Real> rhs_;                 // padded cells
  PressureMultigrid multigrid_;
  SlipNodes* slip_ = nullptr;
  bool given_ = false, sticks_ = false;
  SealedParts parts_;  // where motion is prescribed
  linalg::PcgWorkspace pcg_;
  linalg::PcrWorkspace pcr_;
};

}  // namespace efsi::system
