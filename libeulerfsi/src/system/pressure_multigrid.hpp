// Purpose: one V-cycle of geometric multigrid as the preconditioner of the pressure equation.
// Coarse levels go by the faces of cells (system/coarse_pressure) and by full-weighted averages of 1/density: heavy
// solids are inclusions of low mobility, and the harmonic average keeps the number of iterations independent of the
// density ratio (docs/numerics/pressure-solve.md). They have slip walls even where the scene's are no-slip.
#pragma once

#include <span>

#include "system/coarse_pressure.hpp"
#include "system/compliance.hpp"
#include "system/divergence.hpp"
#include "system/pressure_focus.hpp"
#include "system/slip.hpp"

namespace efsi::system {

class PressureMultigrid {
 public:
  // Rebuilds all levels. specific_volume: 1/density per node [m^3/kg]; 0: the node does not move.
  // active: padded cells with an equation; empty: all.
  // fixed: per node of the finest grid, components that walls fix. slip: nodes of the finest grid with two velocities,
  // or none; read until the next build. compliance: per padded cell, its compliance under the pressure; empty: none.
  void build(const Parallel& parallel, const Grid& g, const Walls& walls, const std::vector<std::uint8_t>& fixed,
             const std::vector<Real>& specific_volume, std::vector<std::uint8_t> active,
             const SlipNodes* slip = nullptr, const std::vector<Real>& compliance = {});
  const PressureLevel& finest() const { return finest_; }
  const Compliance& compliance() const { return compliance_; }
  // y = A x; fills the ghosts of x.
  void apply(const Parallel& parallel, std::vector<Real>& x, std::vector<Real>& y);
  // Where the finest level is smoothed; everywhere after build(), and always where there is no other level.
  PressureFocus& focus() { return focus_; }
  // z = one V-cycle applied to r, symmetric positive definite.
  void precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z);
  std::size_t bytes() const;
  // Its residual, padded cells: means nothing between two calls of precondition().
  std::vector<Real>& scratch() { return residual_; }

 private:
  struct CoarseLevel {
    CoarsePressureLevel op;
    Compliance compliance;
    std::vector<Real> specific_volume;  // nodes
    std::vector<Real> x, b, other;      // padded cells; other: the next x, or the residual
  };
  void build_coarse(const Parallel& parallel, const std::vector<Real>& specific_volume,
                    const std::vector<Real>& compliance);
  std::span<const Real> weights() const;  // of the finest level's smoothing steps
  // Smoothing steps on the finest level, everywhere or in focus; x of the first one need not be set. In focus residual_
  // holds the next x, and outside the focus the same as x.
  void smooth_from_zero(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x);
  void smooth(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x, std::size_t step);
  // residual_ = b - A x after smoothing from zero.
  void leave_residual(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x);
  // x of a coarse level from its b.
  void coarse_cycle(const Parallel& parallel, std::size_t l);
  // y += sign (A - A_1) x on the finest level, A_1 without slip and compliance. Ghosts of x must be filled.
  void add_rest(const Parallel& parallel, const std::vector<Real>& x, Real sign, std::vector<Real>& y);
  // The tiles that no focus may leave out: smoothing gives slip and compliance their due everywhere, and of a single
  // level it is all.
  grid::TileMask bound_tiles() const;
  PressureLevel finest_;
  Compliance compliance_;       // of the finest level
  std::vector<Real> residual_;  // padded cells
  std::vector<Real> excess_;    // of slip nodes
  std::vector<Real> given_;     // D x of a level's compliant cells
  std::vector<CoarseLevel> coarse_;
  std::vector<Real> coarsest_;  // weights of the last level's smoothing steps, which solve it
  PressureFocus focus_;
  Parallel serial_;
  const SlipNodes* slip_ = nullptr;
};

}  // namespace efsi::system
