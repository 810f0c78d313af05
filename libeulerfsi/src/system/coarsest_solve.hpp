// Purpose: the last term of multilevel scaling: G on a lattice with so few nodes that it is factored, from trilinear
// elements of an isotropic material with the moduli of its cells.
#pragma once

#include <Eigen/SparseCholesky>
#include <span>
#include <vector>

#include "system/solid_lattice.hpp"

namespace efsi::system {

// What a row of contact has at the nodes of a lattice, and its stiffness [kg].
struct LatticeRow {
  std::vector<std::pair<std::int32_t, double>> parts;  // node, weight
  Mat3d stiffness;
};

class CoarsestSolve {
 public:
  void assemble(const SolidLattice& lattice);
  // From now on these rows are in it; the last ones go.
  void set_rows(std::span<const LatticeRow> rows);
  // z = A^-1 r, three values per node; 0 where nothing moves.
  void solve(const std::vector<Real>& r, std::vector<Real>& z);
  std::size_t bytes() const;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  Matrix bare_, with_rows_;  // lower half
  std::vector<Real> moves_;  // 0: every child is constrained
  Eigen::SimplicialLDLT<Matrix> factors_;
  bool factored_ = false;
  Eigen::VectorXd load_, ordered_;
};

}  // namespace efsi::system
