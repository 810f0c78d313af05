// Purpose: slow twin of the pressure equation: J, M and the walls as assembled matrices.
// Paper: Sec. 4.2, Eq. 11, Eq. 12: J_{c,(n,a)} = +-h^2/4 for the 8 corners n of cell c, A = J W J^T.
#pragma once

#include <Eigen/Sparse>
#include <vector>

#include "grid/boundary.hpp"

namespace efsi::reference {

struct AssembledConstraint {
  grid::Grid g;
  Eigen::SparseMatrix<double> j;  // cells x 3 nodes; nodes of opposite periodic faces are one
  Eigen::VectorXd w;              // 1/m per node and component, 0 where a wall fixes it

  // The node's own index: the first of its periodic copies.
  std::size_t own(int i, int jj, int k) const {
    int q[3] = {i, jj, k};
    for (std::size_t a = 0; a < 3; ++a)
      if (g.periodic[a]) q[a] %= g.cells[a];
    return g.node(q[0], q[1], q[2]);
  }

  AssembledConstraint(const grid::Grid& box, const grid::Walls& walls, const std::vector<Real>& specific_volume)
      : g(box) {
    const auto columns = static_cast<Eigen::Index>(3 * g.node_count());
    j.resize(static_cast<Eigen::Index>(g.cell_count()), columns);
    w = Eigen::VectorXd::Zero(columns);
    std::vector<double> volume(g.node_count(), 0.0);  // an eighth of each cell around a node
    std::vector<Eigen::Triplet<double>> entries;
    const double area = g.h * g.h / 4.0;
    for (int k = 0; k < g.cells[2]; ++k)
      for (int jj = 0; jj < g.cells[1]; ++jj)
        for (int i = 0; i < g.cells[0]; ++i)
          for (const auto& corner : grid::kCorner) {
            const std::size_t n = own(i + corner[0], jj + corner[1], k + corner[2]);
            volume[n] += g.h * g.h * g.h / 8.0;
            for (int a = 0; a < 3; ++a)
              entries.emplace_back(static_cast<int>(g.cell(i, jj, k)), static_cast<int>(3 * n) + a,
                                   corner[a] ? area : -area);
          }
    j.setFromTriplets(entries.begin(), entries.end());
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int jj = 0; jj <= g.cells[1]; ++jj)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t n = own(i, jj, k);
          const unsigned fixed = grid::fixed_components(g, walls, i, jj, k);
          for (unsigned a = 0; a < 3; ++a)
            w[static_cast<Eigen::Index>(3 * n + a)] =
                fixed & (1u << a) ? 0.0 : static_cast<double>(specific_volume[n]) / volume[n];
        }
  }

  Eigen::SparseMatrix<double> matrix() const { return j * w.asDiagonal() * Eigen::SparseMatrix<double>(j.transpose()); }
};

}  // namespace efsi::reference
