// Purpose: compliance of cells under the pressure: a diagonal of the pressure equation, J W J^T + D, on all levels of
// its multigrid (docs/numerics/bulk-by-pressure.md). Only compliant cells are stored.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "system/divergence.hpp"

namespace efsi::system {

class Compliance {
 public:
  // cells: D per padded cell [m^4/kg], 0: rigid; empty: all are.
  void set(const std::vector<Real>& cells, const PressureGrid& level);
  bool empty() const { return cells_.empty(); }
  const std::vector<std::size_t>& cells() const { return cells_; }  // padded, in order
  // 1/A_cc -> 1/(A_cc + D_c)
  void add_to_diagonal(std::vector<Real>& inverse_diagonal) const;
  // out = D x of its cells, one value each
  void multiply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& out) const;
  // y += sign D x
  void add(const Parallel& parallel, Real sign, const std::vector<Real>& x, std::vector<Real>& y) const;
  // x -= weight d given, what a Jacobi step without D lacks; given: D x of its cells before the step
  void relax(const Parallel& parallel, Real weight, const std::vector<Real>& inverse_diagonal,
             const std::vector<Real>& given, std::vector<Real>& x) const;
  std::size_t bytes() const { return cells_.size() * (sizeof(std::size_t) + sizeof(Real)); }

 private:
  std::int64_t count() const { return static_cast<std::int64_t>(cells_.size()); }

  std::vector<std::size_t> cells_;
  std::vector<Real> values_;
};

}  // namespace efsi::system
