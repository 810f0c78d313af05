#include "system/row_inverse.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "system/velocity_system.hpp"

namespace efsi::system {
namespace {

// The root of a symmetric matrix without negative eigenvalues, but for rounding.
Mat3d root_of(const Mat3d& s) {
  Eigen::SelfAdjointEigenSolver<Mat3d> eigen;
  eigen.computeDirect(s);
  const Vec3d roots = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return eigen.eigenvectors() * roots.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace

RowInverse::RowInverse(const std::vector<Penalty>& penalties, const std::vector<Real>& inverse_diagonal,
                       const std::vector<Real>& free) {
  for (const Penalty& p : penalties)
    for (const RowPart& part : p.parts)
      for (std::size_t i = 3 * part.unknown; i < 3 * part.unknown + 3; ++i)
        if (free[i] > 0) entry_.push_back(i);
  std::sort(entry_.begin(), entry_.end());
  entry_.erase(std::unique(entry_.begin(), entry_.end()), entry_.end());
  inverse_.resize(static_cast<Eigen::Index>(entry_.size()));
  for (std::size_t e = 0; e < entry_.size(); ++e)
    inverse_[static_cast<Eigen::Index>(e)] = static_cast<double>(inverse_diagonal[entry_[e]]);

  std::vector<Eigen::Triplet<double>> values;
  for (std::size_t p = 0; p < penalties.size(); ++p) {
    const Mat3d root = root_of(penalties[p].stiffness.cast<double>());
    for (const RowPart& part : penalties[p].parts)
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t i = 3 * part.unknown + a;
        if (!(free[i] > 0)) continue;
        const auto column = std::lower_bound(entry_.begin(), entry_.end(), i) - entry_.begin();
        for (Eigen::Index row = 0; row < 3; ++row)
          values.emplace_back(3 * static_cast<Eigen::Index>(p) + row, column,
                              static_cast<double>(part.weight) * root(row, static_cast<Eigen::Index>(a)));
      }
  }
  const auto rows = 3 * static_cast<Eigen::Index>(penalties.size());
  w_.resize(rows, static_cast<Eigen::Index>(entry_.size()));
  w_.setFromTriplets(values.begin(), values.end());
  Eigen::SparseMatrix<double> one(rows, rows);
  one.setIdentity();
  const Eigen::SparseMatrix<double> scaled = w_ * inverse_.asDiagonal(), transposed = w_.transpose();
  factors_.compute(one + scaled * transposed);
}

void RowInverse::correct(std::vector<Real>& z) const {
  Eigen::VectorXd at(inverse_.size());
  for (std::size_t e = 0; e < entry_.size(); ++e) at[static_cast<Eigen::Index>(e)] = static_cast<double>(z[entry_[e]]);
  const Eigen::VectorXd push = factors_.solve(w_ * at);
  const Eigen::VectorXd change = inverse_.cwiseProduct(w_.transpose() * push);
  for (std::size_t e = 0; e < entry_.size(); ++e)
    z[entry_[e]] -= static_cast<Real>(change[static_cast<Eigen::Index>(e)]);
}

std::size_t RowInverse::bytes() const {
  constexpr std::size_t kEntry = sizeof(double) + sizeof(int);
  const auto stored = static_cast<std::size_t>(w_.nonZeros() + factors_.matrixL().nestedExpression().nonZeros());
  return entry_.size() * (sizeof(std::size_t) + sizeof(double)) + stored * kEntry;
}

}  // namespace efsi::system
