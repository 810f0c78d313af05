// Purpose: slow twin of multilevel scaling: the sum of P D^-1 P^T over the levels as a full matrix, P from hat
// functions on each lattice, D and the coarsest G element by element.
#pragma once

#include <Eigen/Dense>
#include <map>
#include <tuple>

#include "solid/element/material_force.hpp"
#include "system/velocity_system.hpp"

namespace efsi::reference {

// lambda V and mu V of the isotropic stiffness with the traces of an element's: from its answers to u_i = x_j.
inline std::pair<double, double> element_moduli(const solid::SolidWork& work, double h, std::size_t e) {
  Eigen::Matrix<double, 24, 9> affine, answers;
  for (Eigen::Index m = 0; m < 9; ++m) {
    Real in[24] = {}, out[24];
    for (std::size_t a = 0; a < 8; ++a)
      in[3 * a + static_cast<std::size_t>(m % 3)] = static_cast<Real>(h * grid::kCorner[a][m / 3]);
    solid::element_stiffness(work, h, e, in, out);
    for (Eigen::Index i = 0; i < 24; ++i) {
      affine(i, m) = static_cast<double>(in[i]);
      answers(i, m) = static_cast<double>(out[i]);
    }
  }
  const Eigen::Matrix<double, 9, 9> c = affine.transpose() * answers;
  const Eigen::Matrix<double, 9, 1> swell = Mat3d::Identity().reshaped();
  const double bulk = swell.dot(c * swell) / 9.0, mu = (c.trace() - 3.0 * bulk) / 10.0;
  return {bulk - 2.0 / 3.0 * mu, mu};
}

// Integrals over the unit cell of d_i N_a d_j N_b, corners a and b, from those of hat functions along each axis.
inline Mat3d hat_integrals(std::size_t a, std::size_t b) {
  Mat3d product;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double integral = 1.0;
      for (int k = 0; k < 3; ++k) {
        const int p = grid::kCorner[a][k], q = grid::kCorner[b][k];
        const double slope_p = p ? 1.0 : -1.0, slope_q = q ? 1.0 : -1.0;
        if (i == k && j == k)
          integral *= slope_p * slope_q;
        else if (i == k)
          integral *= slope_p * 0.5;
        else if (j == k)
          integral *= slope_q * 0.5;
        else
          integral *= p == q ? 1.0 / 3.0 : 1.0 / 6.0;
      }
      product(i, j) = integral;
    }
  return product;
}

// Without the fine diagonal. Bands of the solids are the whole grid.
inline Eigen::MatrixXd multilevel_scaling(const system::VelocitySystem& system, std::size_t levels) {
  const auto size = static_cast<Eigen::Index>(3 * system.unknowns());
  Eigen::VectorXd free(size);
  for (Eigen::Index i = 0; i < size; ++i) free[i] = static_cast<double>(system.free()[static_cast<std::size_t>(i)]);
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * system.penalties().size()), size);
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(b.rows(), b.rows());
  for (std::size_t p = 0; p < system.penalties().size(); ++p) {
    const auto row = static_cast<Eigen::Index>(3 * p);
    for (const system::RowPart& part : system.penalties()[p].parts)
      b.block<3, 3>(row, static_cast<Eigen::Index>(3 * part.unknown)).diagonal().array() +=
          static_cast<double>(part.weight);
    s.block<3, 3>(row, row) = system.penalties()[p].stiffness.cast<double>();
  }
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t level = 1; level <= levels; ++level) {
    const int width = 1 << level;
    const double span = width * system.cell();
    // Nodes of the lattice: the corners of its cells that hold elements.
    using Node = std::tuple<std::size_t, int, int, int>;  // solid, place
    std::map<Node, Eigen::Index> node;
    const auto corner = [&](std::size_t l, const Vec3i& cell, std::size_t a) {
      const auto& c = grid::kCorner[a];
      const Node key{l, cell[0] / width + c[0], cell[1] / width + c[1], cell[2] / width + c[2]};
      return 3 * node.try_emplace(key, static_cast<Eigen::Index>(node.size())).first->second;
    };
    std::vector<std::tuple<std::size_t, Vec3i, double, double>> elements;  // solid, cell, moduli
    for (std::size_t l = 0; l < system.solids(); ++l) {
      const solid::SolidWork& work = *system.solid(l).work;
      for (std::size_t e = 0; e < work.element_cell.size(); ++e) {
        const auto [lambda, mu] = element_moduli(work, system.cell(), e);
        const auto factor = static_cast<double>(system.stiffness_factor(l, e));
        elements.emplace_back(l, system.grid().node_place(static_cast<std::size_t>(work.element_corner[e])),
                              factor * lambda, factor * mu);
        for (std::size_t a = 0; a < 8; ++a) corner(l, std::get<1>(elements.back()), a);
      }
    }
    const auto columns = static_cast<Eigen::Index>(3 * node.size());
    Eigen::MatrixXd p = Eigen::MatrixXd::Zero(size, columns), g = Eigen::MatrixXd::Zero(columns, columns);
    for (std::size_t u = 0; u < system.nodes().size(); ++u) {
      const Vec3i at = system.grid().node_place(system.nodes()[u]);
      const std::size_t l = system.solid_of(u);
      for (std::size_t a = 0; a < 8; ++a) {
        double hat = 1.0;
        for (std::size_t i = 0; i < 3; ++i) {
          const double x = static_cast<double>(at[i] % width) / width;
          hat *= grid::kCorner[a][i] ? x : 1.0 - x;
        }
        if (!(hat > 0.0)) continue;
        const auto column = corner(l, at, a);
        p.block<3, 3>(static_cast<Eigen::Index>(3 * u), column).diagonal().setConstant(hat);
        g.block<3, 3>(column, column).diagonal().array() += hat * system.inertia(u);
      }
    }
    const bool last = level == levels;
    for (const auto& [l, cell, lambda, mu] : elements)
      for (std::size_t a = 0; a < 8; ++a)
        for (std::size_t c = 0; c < 8; ++c) {
          const Mat3d k = hat_integrals(a, c);
          const Mat3d whole = (lambda * k + mu * (k.transpose() + k.trace() * Mat3d::Identity())) / (span * span);
          if (last || a == c)
            g.block<3, 3>(corner(l, cell, a), corner(l, cell, c)) +=
                last ? whole : Mat3d(whole.diagonal().asDiagonal());
        }
    const Eigen::MatrixXd rows = b * p, pushed = rows.transpose() * s * rows;
    if (last)
      g += pushed;
    else
      g.diagonal() += pushed.diagonal();
    p = free.asDiagonal() * p;
    for (Eigen::Index c = 0; c < columns; ++c) {  // what is held altogether answers to nothing
      if (p.col(c).norm() > 0.0) continue;
      g.row(c).setZero();
      g.col(c).setZero();
      g(c, c) = 1.0;
    }
    sum += p * g.ldlt().solve(Eigen::MatrixXd(p.transpose()));
  }
  return sum;
}

}  // namespace efsi::reference
