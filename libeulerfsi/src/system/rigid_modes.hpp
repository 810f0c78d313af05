// Purpose: what contact does to solids as a whole, as a part of the preconditioner: z = D^-1 r + R (R^T A R)^-1 R^T r,
// R the motions that strain nothing, A the mass with the penalties of the rows that are closed. By the diagonal alone
// the push of a row goes through a body a cell in each iteration.
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "system/contact_row.hpp"

namespace efsi::system {

class RigidModes {
 public:
  // Of the solids in the rows, as far as walls leave them free.
  RigidModes(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<RowAct>& acts,
             const VelocitySystem& system);
  // z += R (R^T A R)^-1 R^T r
  void add(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) const;

 private:
  using Modes = Eigen::Matrix<double, 3, 6>;  // velocity at a place by shift and turn
  struct Body {
    std::size_t begin = 0, end = 0;  // unknowns
    Vec3d center = Vec3d::Zero();
    unsigned held = 0;       // axes along which it cannot move
    Eigen::Index first = 0;  // of its six entries
  };
  Modes modes(const Body& body, std::size_t unknown) const;

  const VelocitySystem& system_;
  std::vector<Body> bodies_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace efsi::system
