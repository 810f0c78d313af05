// Purpose: slow twin of the split of a step: velocity (Eq. 8) and pressure (Eq. 12) of one step as one system,
//   A v + J^T q = f,   J v = 0,      A = G on nodes that carry solids, M elsewhere, of the components that walls leave.
// Direct: q by elimination of v, J A^-1 J^T q = J A^-1 f, whose null vectors (constant and alternating pressures) push
// nothing. Paper: Sec. 4.3 to 4.5. For boxes of a few thousand nodes, without slip nodes and periodic faces.
#pragma once

#include <Eigen/Dense>

#include "nodes/node_fields.hpp"
#include "reference/assembled_constraint.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::reference {

struct DirectStep {
  Eigen::VectorXd f, mass;  // 3 per node: the right-hand side [kg m/s], mass of all matter, 0 where walls fix it [kg]
  Eigen::VectorXd v;        // what both equations agree on [m/s]
  double flux = 0.0;        // |J v| over |J A^-1 f|
  double residual = 0.0;    // |f - A v - J^T q| over |f|

  // After line 8 of Alg. 1, before line 9: v_star is the velocity there.
  DirectStep(const Parallel& parallel, const sim::Matter& matter, const grid::VectorField& v_star,
             sim::VelocityEquation& elasticity) {
    const grid::Grid& g = matter.common.grid;
    const auto n = static_cast<Eigen::Index>(3 * g.node_count());
    f = mass = Eigen::VectorXd::Zero(n);
    for (std::size_t node = 0; node < g.node_count(); ++node)
      for (std::size_t a = 0; a < 3; ++a) {
        if (matter.fixed[node] & (1u << a)) continue;
        const auto i = static_cast<Eigen::Index>(3 * node + a);
        mass[i] = static_cast<double>(matter.mass[node]);
        f[i] = mass[i] * static_cast<double>(v_star.c[a][node]);
      }
    read_stiffness(parallel, elasticity);

    const AssembledConstraint constraint(g, matter.common.walls, matter.specific_volume);
    const Eigen::MatrixXd jt = Eigen::MatrixXd(constraint.j.transpose());
    const Eigen::MatrixXd moved = solve(jt);  // A^-1 J^T
    const Eigen::VectorXd free = solve(f), wanted = jt.transpose() * free;
    const Eigen::MatrixXd schur = jt.transpose() * moved;
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> inverse;
    inverse.setThreshold(1e-9);
    inverse.compute(schur);
    const Eigen::VectorXd q = inverse.solve(wanted);
    v = free - moved * q;
    flux = (jt.transpose() * v).norm() / wanted.norm();
    Eigen::VectorXd left = f - multiply(v) - jt * q;
    for (Eigen::Index i = 0; i < n; ++i)
      if (mass[i] == 0.0) left[i] = 0.0;
    residual = left.norm() / f.norm();
  }

  // Of a change of the velocity: sqrt(2 times its kinetic energy).
  double length(const Eigen::VectorXd& change) const { return std::sqrt(change.dot(mass.cwiseProduct(change))); }

  static Eigen::VectorXd of_field(const grid::VectorField& field) {
    Eigen::VectorXd x(static_cast<Eigen::Index>(3 * field.size()));
    for (std::size_t node = 0; node < field.size(); ++node)
      for (std::size_t a = 0; a < 3; ++a)
        x[static_cast<Eigen::Index>(3 * node + a)] = static_cast<double>(field.c[a][node]);
    return x;
  }

 private:
  std::vector<Eigen::Index> stiff_;  // components that G couples
  Eigen::MatrixXd g_;                // on them
  Eigen::LDLT<Eigen::MatrixXd> inverse_;

  // G column by column, and f*.
  void read_stiffness(const Parallel& parallel, sim::VelocityEquation& elasticity) {
    system::VelocitySystem& system = elasticity.system;
    std::vector<std::size_t> own;  // entries of the unknowns that move
    for (std::size_t e = 0; e < system.free().size(); ++e)
      if (system.free()[e] > 0) own.push_back(e);
    const auto count = static_cast<Eigen::Index>(own.size());
    g_.resize(count, count);
    std::vector<Real> x(system.free().size(), 0), y;
    for (Eigen::Index c = 0; c < count; ++c) {
      const std::size_t e = own[static_cast<std::size_t>(c)];
      stiff_.push_back(static_cast<Eigen::Index>(3 * system.nodes()[e / 3] + e % 3));
      f[stiff_.back()] = static_cast<double>(elasticity.f_star[e]);
      x[e] = 1;
      system.apply(parallel, x, y);
      x[e] = 0;
      for (Eigen::Index r = 0; r < count; ++r) g_(r, c) = static_cast<double>(y[own[static_cast<std::size_t>(r)]]);
    }
    g_ = 0.5 * (g_ + g_.transpose().eval());
    inverse_.compute(g_);
  }
  // A^-1 b; 0 where walls fix it.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const {
    Eigen::MatrixXd x = b;
    for (Eigen::Index i = 0; i < b.rows(); ++i) x.row(i) *= mass[i] > 0.0 ? 1.0 / mass[i] : 0.0;
    const Eigen::MatrixXd own = inverse_.solve(Eigen::MatrixXd(b(stiff_, Eigen::all)));
    for (std::size_t i = 0; i < stiff_.size(); ++i) x.row(stiff_[i]) = own.row(static_cast<Eigen::Index>(i));
    return x;
  }
  Eigen::VectorXd multiply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd y = mass.cwiseProduct(x);
    const Eigen::VectorXd own = g_ * x(stiff_);
    for (std::size_t i = 0; i < stiff_.size(); ++i) y[stiff_[i]] = own[static_cast<Eigen::Index>(i)];
    return y;
  }
};

}  // namespace efsi::reference
