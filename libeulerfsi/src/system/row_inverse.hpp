// Purpose: what penalties change in the inverse of a diagonal, exactly, by the identity of Sherman, Morrison and
// Woodbury:
//   (D + B^T S B)^-1 = D^-1 - D^-1 W^T (1 + W D^-1 W^T)^-1 W D^-1,   W = S^(1/2) B
// Rows that share nodes are coupled. With the diagonal of B^T S B alone the penalties of a contact cost as
// many iterations as elasticity does, and the more the stiffer they are.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <span>
#include <vector>

#include "base/math_types.hpp"
#include "base/parallel.hpp"

namespace efsi::system {

struct Penalty;

class RowInverse {
 public:
  // inverse_diagonal: of D, 3 values per unknown; free: 0 where nothing moves, which the rows do not see.
  RowInverse(const Parallel& parallel, const std::vector<Penalty>& penalties, const std::vector<Real>& inverse_diagonal,
             const std::vector<Real>& free);
  // z = D^-1 r becomes (D + B^T S B)^-1 r.
  void correct(const Parallel& parallel, std::vector<Real>& z) const;
  std::size_t bytes() const;

 private:
  struct Weight {
    std::size_t at;  // an unknown of a row, as a place in unknown_; or a row of an unknown
    double weight;
  };
  // Of each row its unknowns, or of each unknown its rows.
  struct Weights {
    std::vector<std::size_t> begin;
    std::vector<Weight> entries;
    std::span<const Weight> of(std::size_t i) const {
      return std::span(entries).subspan(begin[i], begin[i + 1] - begin[i]);
    }
  };
  void number(const Parallel& parallel, const std::vector<Penalty>& penalties);
  Eigen::SparseMatrix<double> assemble(const Parallel& parallel) const;  // the lower half of 1 + W D^-1 W^T

  std::vector<std::size_t> unknown_;  // that rows act on, in order
  std::vector<Vec3d> inverse_;        // of D there; 0: does not move
  std::vector<Mat3d> root_;           // S^(1/2) of each row
  Weights of_row_, of_unknown_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace efsi::system
