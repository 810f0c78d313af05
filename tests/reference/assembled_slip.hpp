// Purpose: slow twin of the pressure equation with several velocities at surface nodes: J and W as full matrices, W
// from the masses and a constraint: the common normal component, or where solids share the node that it makes no
// volume.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "reference/assembled_constraint.hpp"
#include "system/slip.hpp"

namespace efsi::reference {

struct AssembledSlip {
  AssembledConstraint one;  // one velocity per node
  Eigen::MatrixXd j, w;     // cells x unknowns: the velocities of the nodes, then those of the solids at slip nodes

  AssembledSlip(const grid::Grid& g, const grid::Walls& walls, const std::vector<Real>& specific_volume,
                const system::SlipNodes& slip)
      : one(g, walls, specific_volume) {
    const auto nodes = static_cast<Eigen::Index>(3 * g.node_count());
    const auto columns = nodes + static_cast<Eigen::Index>(3 * slip.nodes().size());
    j = Eigen::MatrixXd::Zero(one.j.rows(), columns);
    j.leftCols(nodes) = one.j;
    w = Eigen::MatrixXd::Zero(columns, columns);
    w.topLeftCorner(nodes, nodes).diagonal() = one.w;
    for (std::size_t t = 0; t < slip.nodes().size(); ++t) {
      const system::SlipNode& n = slip.nodes()[t];
      const auto fluid = static_cast<Eigen::Index>(3 * n.node), solid = nodes + static_cast<Eigen::Index>(3 * t);
      for (std::size_t corner = 0; corner < 8; ++corner) {
        if (!(n.solid_cells >> corner & 1u)) continue;
        const auto& c = grid::kCorner[corner];
        const auto cell = static_cast<Eigen::Index>(g.cell(n.i - c[0], n.j - c[1], n.k - c[2]));
        j.block<1, 3>(cell, solid) = j.block<1, 3>(cell, fluid);
        j.block<1, 3>(cell, fluid).setZero();
      }
      if (n.shared()) {
        if (t == 0 || slip.nodes()[t - 1].node != n.node) share(slip, t, nodes);
        continue;
      }
      // The inverse mass of both velocities under n . (v_s - v_f) = 0.
      Eigen::Matrix<double, 6, 6> inverse = Eigen::Matrix<double, 6, 6>::Zero();
      inverse.topLeftCorner<3, 3>().diagonal().setConstant(1.0 / static_cast<double>(n.fluid_mass));
      inverse.bottomRightCorner<3, 3>().diagonal().setConstant(1.0 / static_cast<double>(n.solid_mass));
      Eigen::Matrix<double, 6, 1> tie;
      tie << n.normal.cast<double>(), -n.normal.cast<double>();
      const Eigen::Matrix<double, 6, 1> reaction = inverse * tie;
      inverse -= reaction * reaction.transpose() / tie.dot(reaction);
      w.block<3, 3>(fluid, fluid) = inverse.topLeftCorner<3, 3>();
      w.block<3, 3>(fluid, solid) = inverse.topRightCorner<3, 3>();
      w.block<3, 3>(solid, fluid) = inverse.bottomLeftCorner<3, 3>();
      w.block<3, 3>(solid, solid) = inverse.bottomRightCorner<3, 3>();
    }
  }

  // W of a shared node, t: its first entry.
  void share(const system::SlipNodes& slip, std::size_t t, Eigen::Index nodes) {
    const system::SlipNode& first = slip.nodes()[t];
    std::vector<Eigen::Index> column;  // of each velocity
    Eigen::VectorXd inverse(3 * (first.solids + 1)), side(inverse.size());
    const auto add = [&](Eigen::Index at, unsigned cells, unsigned fixed, double mass) {
      const auto row = static_cast<Eigen::Index>(3 * column.size());
      column.push_back(at);
      for (unsigned a = 0; a < 3; ++a) {
        const bool given = fixed & (1u << a);
        inverse[row + a] = given ? 0.0 : 1.0 / mass;
        side[row + a] = 0.0;
        for (unsigned c = 0; c < 8; ++c)
          if (!given && cells >> c & 1u) side[row + a] += grid::kCorner[c][a] ? 1.0 : -1.0;
      }
    };
    for (std::size_t s = t; s < t + first.solids; ++s)
      add(nodes + static_cast<Eigen::Index>(3 * s), slip.nodes()[s].solid_cells, slip.nodes()[s].fixed,
          static_cast<double>(slip.nodes()[s].solid_mass));
    const auto fluid = static_cast<Eigen::Index>(3 * first.node);
    w.block<3, 3>(fluid, fluid).setZero();
    if (first.fluid_cells) add(fluid, first.fluid_cells, first.fluid_fixed, static_cast<double>(first.fluid_mass));
    const auto size = static_cast<Eigen::Index>(3 * column.size());
    Eigen::MatrixXd local = inverse.head(size).asDiagonal();
    const Eigen::VectorXd reaction = local * side.head(size);
    const double sum = side.head(size).dot(reaction);
    if (first.in_fluid && sum > 0.0) local -= reaction * reaction.transpose() / sum;
    for (std::size_t p = 0; p < column.size(); ++p)
      for (std::size_t q = 0; q < column.size(); ++q)
        w.block<3, 3>(column[p], column[q]) =
            local.block<3, 3>(static_cast<Eigen::Index>(3 * p), static_cast<Eigen::Index>(3 * q));
  }

  Eigen::VectorXd unknowns(const grid::VectorField& v, system::SlipNodes& slip) const {
    Eigen::VectorXd x(j.cols());
    for (std::size_t n = 0; n < v.size(); ++n) x.segment<3>(static_cast<Eigen::Index>(3 * n)) = v.at(n).cast<double>();
    for (std::size_t t = 0; t < slip.nodes().size(); ++t)
      x.segment<3>(static_cast<Eigen::Index>(3 * (v.size() + t))) = slip.solid_velocity()[t].cast<double>();
    return x;
  }
};

}  // namespace efsi::reference
