// Purpose: what penalties change in the inverse of a diagonal, exactly, by the identity of Sherman, Morrison and
// Woodbury:
//   (D + B^T S B)^-1 = D^-1 - D^-1 W^T (1 + W D^-1 W^T)^-1 W D^-1,   W = S^(1/2) B
// Rows that share nodes are coupled. With the diagonal of B^T S B alone the penalties of a contact cost as
// many iterations as elasticity does, and the more the stiffer they are.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::system {

struct Penalty;

class RowInverse {
 public:
  // inverse_diagonal: of D, 3 values per unknown; free: 0 where nothing moves, which the rows do not see.
  RowInverse(const std::vector<Penalty>& penalties, const std::vector<Real>& inverse_diagonal,
             const std::vector<Real>& free);
  // z = D^-1 r becomes (D + B^T S B)^-1 r.
  void correct(std::vector<Real>& z) const;
  std::size_t bytes() const;

 private:
  std::vector<std::size_t> entry_;  // of unknowns that rows act on, in order
  Eigen::VectorXd inverse_;         // of D there
  Eigen::SparseMatrix<double> w_;   // 3 rows per penalty, columns as entry_
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace efsi::system
