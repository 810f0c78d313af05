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

void RowInverse::number(const Parallel& parallel, const std::vector<Penalty>& penalties) {
  of_row_.begin = {0};
  for (const Penalty& p : penalties) {
    for (const RowPart& part : p.parts) unknown_.push_back(part.unknown);
    of_row_.begin.push_back(unknown_.size());
  }
  of_row_.entries.resize(unknown_.size());
  std::sort(unknown_.begin(), unknown_.end());
  unknown_.erase(std::unique(unknown_.begin(), unknown_.end()), unknown_.end());
  parallel.for_each(static_cast<std::int64_t>(penalties.size()), [&](std::int64_t n) {
    const auto row = static_cast<std::size_t>(n);
    std::size_t entry = of_row_.begin[row];
    for (const RowPart& part : penalties[row].parts) {
      const auto at = std::lower_bound(unknown_.begin(), unknown_.end(), part.unknown) - unknown_.begin();
      of_row_.entries[entry++] = {static_cast<std::size_t>(at), static_cast<double>(part.weight)};
    }
  });
  of_unknown_.begin.assign(unknown_.size() + 1, 0);
  for (const Weight& w : of_row_.entries) ++of_unknown_.begin[w.at + 1];
  for (std::size_t u = 0; u < unknown_.size(); ++u) of_unknown_.begin[u + 1] += of_unknown_.begin[u];
  of_unknown_.entries.resize(of_row_.entries.size());
  std::vector<std::size_t> next(of_unknown_.begin.begin(), of_unknown_.begin.end() - 1);
  for (std::size_t row = 0; row < penalties.size(); ++row)
    for (const Weight& w : of_row_.of(row)) of_unknown_.entries[next[w.at]++] = {row, w.weight};
}

Eigen::SparseMatrix<double> RowInverse::assemble(const Parallel& parallel) const {
  struct Block {
    std::size_t row;
    Vec3d sum;  // of w D^-1 w over the unknowns that two rows share
  };
  const std::size_t rows = root_.size();
  std::vector<std::vector<Block>> columns(rows);  // of each row the later ones, and itself
  parallel.for_ranges(static_cast<std::int64_t>(rows), [&](std::int64_t begin, std::int64_t end) {
    constexpr std::size_t kNone = static_cast<std::size_t>(-1);
    std::vector<std::size_t> place(rows, kNone);
    for (auto column = static_cast<std::size_t>(begin); column < static_cast<std::size_t>(end); ++column) {
      std::vector<Block>& blocks = columns[column];
      for (const Weight& mine : of_row_.of(column))
        for (const Weight& other : of_unknown_.of(mine.at)) {
          if (other.at < column) continue;
          if (place[other.at] == kNone) {
            place[other.at] = blocks.size();
            blocks.push_back({other.at, Vec3d::Zero()});
          }
          blocks[place[other.at]].sum += mine.weight * other.weight * inverse_[mine.at];
        }
      for (const Block& block : blocks) place[block.row] = kNone;
      std::sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.row < b.row; });
    }
  });

  const auto size = 3 * static_cast<Eigen::Index>(rows);
  Eigen::SparseMatrix<double> matrix(size, size);
  int* first = matrix.outerIndexPtr();
  for (std::size_t column = 0; column < rows; ++column)
    for (std::size_t a = 0; a < 3; ++a)
      first[3 * column + a + 1] = first[3 * column + a] + static_cast<int>(3 * columns[column].size() - a);
  matrix.resizeNonZeros(first[size]);
  parallel.for_each(static_cast<std::int64_t>(rows), [&](std::int64_t n) {
    const auto column = static_cast<std::size_t>(n);
    for (Eigen::Index a = 0; a < 3; ++a) {
      int at = first[3 * n + a];
      for (const Block& block : columns[column]) {
        const Vec3d values = root_[block.row] * block.sum.cwiseProduct(root_[column].col(a));
        for (Eigen::Index i = block.row == column ? a : 0; i < 3; ++i, ++at) {
          matrix.innerIndexPtr()[at] = static_cast<int>(3 * block.row) + static_cast<int>(i);
          matrix.valuePtr()[at] = values[i] + (block.row == column && i == a ? 1.0 : 0.0);
        }
      }
    }
  });
  return matrix;
}

RowInverse::RowInverse(const Parallel& parallel, const std::vector<Penalty>& penalties,
                       const std::vector<Real>& inverse_diagonal, const std::vector<Real>& free)
    : root_(penalties.size()) {
  number(parallel, penalties);
  for (const std::size_t u : unknown_) {
    Vec3d& inverse = inverse_.emplace_back(Vec3d::Zero());
    for (std::size_t a = 0; a < 3; ++a)
      if (free[3 * u + a] > 0) inverse[static_cast<Eigen::Index>(a)] = static_cast<double>(inverse_diagonal[3 * u + a]);
  }
  parallel.for_each(static_cast<std::int64_t>(penalties.size()), [&](std::int64_t n) {
    const auto row = static_cast<std::size_t>(n);
    root_[row] = root_of(penalties[row].stiffness.cast<double>());
  });
  factors_.compute(assemble(parallel));
}

void RowInverse::correct(const Parallel& parallel, std::vector<Real>& z) const {
  Eigen::VectorXd push(3 * static_cast<Eigen::Index>(root_.size()));
  const auto for_rows = [&](const auto& body) {
    parallel.for_each(static_cast<std::int64_t>(root_.size()),
                      [&](std::int64_t n) { body(static_cast<std::size_t>(n), push.segment<3>(3 * n)); });
  };
  for_rows([&](std::size_t row, auto own) {
    Vec3d sum = Vec3d::Zero();
    for (const Weight& w : of_row_.of(row))
      for (Eigen::Index a = 0; a < 3; ++a)
        if (inverse_[w.at][a] > 0.0)
          sum[a] += w.weight * static_cast<double>(z[3 * unknown_[w.at] + static_cast<std::size_t>(a)]);
    own = root_[row] * sum;
  });
  push = factors_.solve(push).eval();
  for_rows([&](std::size_t row, auto own) { own = (root_[row] * own).eval(); });
  parallel.for_each(static_cast<std::int64_t>(unknown_.size()), [&](std::int64_t n) {
    const auto u = static_cast<std::size_t>(n);
    Vec3d sum = Vec3d::Zero();
    for (const Weight& w : of_unknown_.of(u)) sum += w.weight * push.segment<3>(3 * static_cast<Eigen::Index>(w.at));
    for (Eigen::Index a = 0; a < 3; ++a)
      if (inverse_[u][a] > 0.0)
        z[3 * unknown_[u] + static_cast<std::size_t>(a)] -= static_cast<Real>(inverse_[u][a] * sum[a]);
  });
}

std::size_t RowInverse::bytes() const {
  const auto stored = static_cast<std::size_t>(factors_.matrixL().nestedExpression().nonZeros());
  return unknown_.size() * (sizeof(std::size_t) + sizeof(Vec3d)) + root_.size() * sizeof(Mat3d) +
         2 * of_row_.entries.size() * sizeof(Weight) + stored * (sizeof(double) + sizeof(int));
}

}  // namespace efsi::system
