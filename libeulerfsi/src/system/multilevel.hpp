// Purpose: multilevel diagonal scaling (Bramble, Pasciak, Xu 1990) as a part of the preconditioner of G: z += sum over
// ever coarser lattices of P D^-1 P^T r, P trilinear interpolation, D the diagonal of G there; the coarsest is solved
// directly. With the fine diagonal alone a load propagates through a solid by one cell per iteration.
#pragma once

#include <vector>

#include "system/coarsest_solve.hpp"
#include "system/solid_lattice.hpp"

namespace efsi::system {

struct Penalty;

class MultilevelScaling {
 public:
  // Of the solids for which `wanted` holds, as far as walls, pins and ties leave their nodes free.
  MultilevelScaling(const Parallel& parallel, const VelocitySystem& system, const std::vector<std::uint8_t>& wanted);
  // From now on these are in G; the last ones go.
  void set_penalties(const Parallel& parallel, const std::vector<Penalty>& penalties);
  // Three values per unknown. free: 0 where a component does not move by itself; r is 0 there.
  void add(const Parallel& parallel, const std::vector<Real>& free, const std::vector<Real>& r, std::vector<Real>& z);
  std::size_t levels() const { return levels_.size(); }
  std::size_t bytes() const;

 private:
  struct Level {
    Interpolation from;          // of the finer one
    std::vector<Real> diagonal;  // of G without penalties, per node [kg]
    std::vector<Real> inverse;   // with them, three per node [1/kg]
    std::vector<Real> r, z;
  };
  std::vector<Level> levels_;  // from fine to coarse
  CoarsestSolve coarsest_;
};

}  // namespace efsi::system
