#include "system/coarsest_solve.hpp"

#include <algorithm>
#include <cmath>

#include "grid/grid.hpp"

namespace efsi::system {
namespace {

using Entries = std::vector<Eigen::Triplet<double>>;
using Blocks = std::array<std::array<Mat3d, 8>, 8>;

// Of the unit cell, corners a and b: the mean of grad N_a grad N_b^T, by 2 x 2 x 2 Gauss points.
const Blocks& gradient_products() {
  static const Blocks table = [] {
    Blocks products;
    for (auto& row : products) row.fill(Mat3d::Zero());
    for (const auto& q : grid::kCorner) {
      Vec3d at, gradient[8];
      for (Eigen::Index i = 0; i < 3; ++i) at[i] = 0.5 + (q[i] - 0.5) / std::sqrt(3.0);
      for (std::size_t a = 0; a < 8; ++a)
        for (Eigen::Index i = 0; i < 3; ++i) {
          gradient[a][i] = grid::kCorner[a][i] ? 1.0 : -1.0;
          for (Eigen::Index j = 0; j < 3; ++j)
            if (j != i) gradient[a][i] *= grid::kCorner[a][j] ? at[j] : 1.0 - at[j];
        }
      for (std::size_t a = 0; a < 8; ++a)
        for (std::size_t b = 0; b < 8; ++b) products[a][b] += gradient[a] * gradient[b].transpose() / 8.0;
    }
    return products;
  }();
  return table;
}

}  // namespace

void CoarsestSolve::assemble(const SolidLattice& lattice) {
  const auto size = 3 * static_cast<Eigen::Index>(lattice.size());
  moves_.resize(3 * lattice.size());
  Entries entries;
  for (std::size_t n = 0; n < lattice.size(); ++n)
    for (std::size_t a = 0; a < 3; ++a) {
      const std::size_t i = 3 * n + a;
      moves_[i] = lattice.moves[n] & (1u << a) ? Real(1) : Real(0);
      entries.emplace_back(static_cast<int>(i), static_cast<int>(i), moves_[i] > 0 ? lattice.mass[n] : 1.0);
    }
  const double inverse_square = 1.0 / (lattice.h * lattice.h);
  for (const SolidLattice::Place& cell : lattice.place) {
    const SolidLattice::Box& box = lattice.boxes[cell.box];
    const std::size_t at = lattice.index(box, cell.at);
    if (!lattice.carries[at]) continue;
    std::array<std::int32_t, 8> node{};
    for (std::size_t a = 0; a < 8; ++a) {
      const auto& c = grid::kCorner[a];
      node[a] = lattice.id[lattice.index(box, {cell.at[0] + c[0], cell.at[1] + c[1], cell.at[2] + c[2]})];
    }
    const double lambda = static_cast<double>(lattice.lambda[at]) * inverse_square,
                 mu = static_cast<double>(lattice.mu[at]) * inverse_square;
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t b = 0; b < 8; ++b) {
        if (node[a] < node[b]) continue;
        const Mat3d& product = gradient_products()[a][b];
        const Mat3d block = lambda * product + mu * (product.transpose() + product.trace() * Mat3d::Identity());
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) {
            const int row = 3 * node[a] + i, column = 3 * node[b] + j;
            if (row >= column && moves_[static_cast<std::size_t>(row)] > 0 &&
                moves_[static_cast<std::size_t>(column)] > 0)
              entries.emplace_back(row, column, block(i, j));
          }
      }
  }
  bare_.resize(size, size);
  bare_.setFromTriplets(entries.begin(), entries.end());
  set_rows({});
}

void CoarsestSolve::set_rows(std::span<const LatticeRow> rows) {
  factored_ = false;
  with_rows_ = bare_;
  if (rows.empty()) return;
  // Many rows act on the same few nodes: what they have at each pair of them is summed first.
  struct Pair {
    int one, other;
    Mat3d sum;
  };
  const std::size_t nodes = moves_.size() / 3;
  std::vector<std::int32_t> pair_of(nodes * nodes, -1);
  std::vector<Pair> pairs;
  for (const LatticeRow& row : rows)
    for (const auto& [one, of_one] : row.parts)
      for (const auto& [other, of_other] : row.parts) {
        if (one < other) continue;
        std::int32_t& at = pair_of[static_cast<std::size_t>(one) * nodes + static_cast<std::size_t>(other)];
        if (at < 0) {
          at = static_cast<std::int32_t>(pairs.size());
          pairs.push_back({one, other, Mat3d::Zero()});
        }
        pairs[static_cast<std::size_t>(at)].sum += of_one * of_other * row.stiffness;
      }
  Entries entries;
  for (const Pair& pair : pairs)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int line = 3 * pair.one + i, column = 3 * pair.other + j;
        if (line >= column && moves_[static_cast<std::size_t>(line)] > 0 &&
            moves_[static_cast<std::size_t>(column)] > 0)
          entries.emplace_back(line, column, pair.sum(i, j));
      }
  Matrix added(bare_.rows(), bare_.cols());
  added.setFromTriplets(entries.begin(), entries.end());
  with_rows_ += added;
}

void CoarsestSolve::solve(const std::vector<Real>& r, std::vector<Real>& z) {
  if (!factored_) {
    factors_.compute(with_rows_);
    factored_ = true;
    load_.resize(bare_.rows());
    ordered_.resize(bare_.rows());
  }
  for (std::size_t i = 0; i < r.size(); ++i)
    load_[static_cast<Eigen::Index>(i)] = static_cast<double>(moves_[i] * r[i]);
  // By hand, since solve() of the factors allocates.
  ordered_.noalias() = factors_.permutationP() * load_;
  factors_.matrixL().solveInPlace(ordered_);
  ordered_.array() /= factors_.vectorD().array();
  factors_.matrixU().solveInPlace(ordered_);
  load_.noalias() = factors_.permutationPinv() * ordered_;
  for (std::size_t i = 0; i < z.size(); ++i) z[i] = moves_[i] * static_cast<Real>(load_[static_cast<Eigen::Index>(i)]);
}

std::size_t CoarsestSolve::bytes() const {
  const auto of = [](const Matrix& m) {
    return static_cast<std::size_t>(m.nonZeros()) * (sizeof(double) + sizeof(int)) +
           static_cast<std::size_t>(m.cols()) * sizeof(int);
  };
  return of(bare_) + of(with_rows_) + (factored_ ? of(factors_.matrixL().nestedExpression()) : 0) +
         moves_.size() * sizeof(Real) + 3 * static_cast<std::size_t>(load_.size()) * sizeof(double);
}

}  // namespace efsi::system
