// Purpose: Eq. 8 with contact by dense algebra: W = B G^-1 B^T, then Gauss-Seidel over the rows, each projected on its
// cone, until nothing moves. What system::solve_contact is compared with.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "system/contact_solve.hpp"

namespace efsi::reference {

struct DenseContact {
  Eigen::VectorXd velocity;
  std::vector<Vec3d> impulses;  // one per row
};

// g: G; f: without the rows.
inline DenseContact dense_contact(const Eigen::MatrixXd& g, const Eigen::VectorXd& f,
                                  const std::vector<system::ContactRow>& rows, int sweeps = 20000) {
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(3 * count, g.rows());
  for (Eigen::Index r = 0; r < count; ++r)
    for (const system::RowPart& part : rows[static_cast<std::size_t>(r)].parts)
      for (Eigen::Index a = 0; a < 3; ++a)
        b(3 * r + a, static_cast<Eigen::Index>(3 * part.unknown) + a) += static_cast<double>(part.weight);
  const Eigen::LDLT<Eigen::MatrixXd> factors(g);
  const Eigen::MatrixXd w = b * factors.solve(b.transpose());
  const Eigen::VectorXd free = b * factors.solve(f);
  Eigen::VectorXd impulse = Eigen::VectorXd::Zero(3 * count);
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    double moved = 0.0;
    for (Eigen::Index r = 0; r < count; ++r) {
      const system::ContactRow& row = rows[static_cast<std::size_t>(r)];
      const Mat3d block = w.block<3, 3>(3 * r, 3 * r);
      const Vec3d before = impulse.segment<3>(3 * r), n = row.normal;
      Vec3d v = free.segment<3>(3 * r) + w.middleRows(3 * r, 3) * impulse;
      const double push = std::max(0.0, n.dot(before) - (n.dot(v) - row.least) / n.dot(block * n));
      v += block * n * (push - n.dot(before));
      Vec3d pull = before - n.dot(before) * n - (v - n.dot(v) * n) / block.trace();
      if (pull.norm() > row.friction * push) pull *= row.friction * push / pull.norm();
      impulse.segment<3>(3 * r) = push * n + pull;
      moved = std::max(moved, (impulse.segment<3>(3 * r) - before).norm());
    }
    if (moved < 1e-12 * impulse.norm()) break;
  }
  DenseContact out{factors.solve(f + b.transpose() * impulse), {}};
  for (Eigen::Index r = 0; r < count; ++r) out.impulses.push_back(impulse.segment<3>(3 * r));
  return out;
}

}  // namespace efsi::reference
