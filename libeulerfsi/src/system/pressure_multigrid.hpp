// Purpose: one V-cycle of geometric multigrid as the preconditioner of the pressure equation.
// Coarse operators are J W J^T on coarser grids with full-weighted averages of 1/density: heavy solids are inclusions
// of low mobility, and the harmonic average keeps the number of iterations independent of the density ratio
// (docs/numerics-choices.md). Coarse levels have slip walls even where the fine level is no-slip.
#pragma once

#include "grid/tiles.hpp"
#include "system/divergence.hpp"
#include "system/slip.hpp"

namespace efsi::system {

class PressureMultigrid {
 public:
  // Rebuilds all levels. specific_volume: 1/density per node [m^3/kg]; 0: the node does not move.
  // active: padded cells with an equation; empty: all.
  // fixed: per node of the finest grid, components that walls fix. slip: nodes of the finest grid with two velocities,
  // or none; read until the next build.
  void build(const Parallel& parallel, const Grid& g, const Walls& walls, const std::vector<std::uint8_t>& fixed,
             const std::vector<Real>& specific_volume, std::vector<std::uint8_t> active,
             const SlipNodes* slip = nullptr);
  const PressureLevel& finest() const { return levels_.front().op; }
  // y = A x; fills the ghosts of x.
  void apply(const Parallel& parallel, std::vector<Real>& x, std::vector<Real>& y) const;
  // From now on the finest level is smoothed only where it matters for a solve that begins with the residual r and ends
  // at `tolerance` of |b|: on the fewest tiles of 8^3 cells that leave less than that, and the tiles beside them.
  void focus(const Parallel& parallel, const std::vector<Real>& r, double b, double tolerance);
  // The same for the tiles that hold some of these padded cells.
  void focus(const std::vector<std::size_t>& cells);
  // Everywhere again.
  void widen() { focused_.clear(); }
  // z = one V-cycle applied to r, symmetric positive definite.
  void precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z);
  std::size_t bytes() const;

 private:
  struct Level {
    PressureLevel op;
    std::vector<Real> specific_volume;
    std::vector<Real> x, b, residual;  // padded cells
  };
  void cycle(const Parallel& parallel, std::size_t l, const std::vector<Real>& b, std::vector<Real>& x);
  void smooth(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& b, std::vector<Real>& x,
              int step) const;
  // y += sign (A - A_1) x on the finest level, A_1 without slip. Ghosts of x must be filled.
  void add_slip(const Parallel& parallel, const std::vector<Real>& x, Real sign, std::vector<Real>& y) const;
  // Smooths these tiles and those beside them, unless they are most of all.
  void set_focus(grid::TileMask& mask);
  // The finest level's part of a V-cycle where it is smoothed in boxes.
  void smooth_in_focus(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x, int step);
  void begin_in_focus(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x);
  std::vector<Level> levels_;
  // Boxes that are smoothed, empty: everywhere; those that smoothing from zero reaches.
  std::vector<CellBox> focused_, reached_;
  Parallel serial_;
  const SlipNodes* slip_ = nullptr;
};

}  // namespace efsi::system
