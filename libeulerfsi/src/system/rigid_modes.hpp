// Purpose: what contact does to solids as a whole, as a part of the preconditioner: z += R (R^T A R)^-1 R^T r, R the
// motions that strain nothing, A the mass with the penalties. With the diagonal alone a load at one place propagates
// through a body by a cell in each iteration.
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "base/math_types.hpp"
#include "base/parallel.hpp"

namespace efsi::system {

class VelocitySystem;
struct Penalty;

class RigidModes {
 public:
  // Of the solids that penalties act on, as far as walls leave them free.
  RigidModes(const Parallel& parallel, const VelocitySystem& system, const std::vector<Penalty>& penalties);
  void add(const Parallel& parallel, const VelocitySystem& system, const std::vector<Real>& r,
           std::vector<Real>& z) const;
  std::size_t bytes() const { return bodies_.size() * sizeof(Body) + place_.size() * sizeof(Vec3d); }

 private:
  struct Body {
    std::size_t begin = 0, end = 0;                                           // unknowns
    Eigen::Index first = 0;                                                   // of its six entries: shift, turn
    Eigen::Matrix<double, 6, 1> moves = Eigen::Matrix<double, 6, 1>::Ones();  // 0: constrained by walls
  };
  using Entries = std::vector<Eigen::Triplet<double>>;
  void add_body(const Parallel& parallel, const VelocitySystem& system, std::size_t solid, Entries& entries);
  // The velocity of an unknown by each of the six.
  Eigen::Matrix<double, 3, 6> modes(const Body& body, std::size_t unknown) const;

  std::vector<Body> bodies_;
  std::vector<Vec3d> place_;  // of the unknowns of the bodies, from their centres [m]
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
};

}  // namespace efsi::system
