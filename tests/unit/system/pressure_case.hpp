// Purpose: pressure equations for tests: a box with walls of every kind and matter of contrasting densities.
#pragma once

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "grid/boundary.hpp"
#include "system/pressure_solve.hpp"

namespace efsi::test {

constexpr double kRoundOff = sizeof(Real) == 8 ? 1e-13 : 2e-6;  // relative, of a sum of a few terms

struct PressureCase {
  std::string name;
  grid::Grid g;
  grid::Walls walls;
  std::vector<Real> specific_volume;  // 1 outside, 1/contrast in a ball; the same at periodic copies
  std::vector<std::uint8_t> fixed;

  PressureCase(std::string text, Vec3i cells, std::array<grid::Wall, 6> faces, double contrast)
      : name(std::move(text)) {
    g.cells = cells;
    g.h = 0.1;
    walls.face = faces;
    for (int a = 0; a < 3; ++a) g.periodic[static_cast<std::size_t>(a)] = walls.lower(a) == grid::Wall::kPeriodic;
    specific_volume.assign(g.node_count(), 1);
    const Vec3d center = 0.5 * g.h * Vec3d(cells[0], cells[1], cells[2]);
    for (int k = 0; k <= cells[2]; ++k)
      for (int j = 0; j <= cells[1]; ++j)
        for (int i = 0; i <= cells[0]; ++i)
          if ((g.node_position(i, j, k) - center).norm() < 0.25 * g.h * cells[0])
            specific_volume[g.node(i, j, k)] = static_cast<Real>(1.0 / contrast);
    fixed = grid::fixed_by_walls(g, walls);
  }

  std::vector<Real> random_cells(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Real> p(g.padded_count(), 0);
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i) p[g.padded(i, j, k)] = static_cast<Real>(normal(random));
    return p;
  }

  // Random velocities that walls allow, equal at periodic copies.
  grid::VectorField random_velocity(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    grid::VectorField v;
    v.assign(g.node_count());
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t n = g.node(i, j, k);
          int q[3] = {i, j, k};
          for (std::size_t a = 0; a < 3; ++a)
            if (g.periodic[a]) q[a] %= g.cells[a];
          const std::size_t own = g.node(q[0], q[1], q[2]);
          for (std::size_t a = 0; a < 3; ++a)
            v.c[a][n] = own != n ? v.c[a][own] : (fixed[n] & (1u << a) ? Real(0) : static_cast<Real>(normal(random)));
        }
    return v;
  }

  double dot(const std::vector<Real>& a, const std::vector<Real>& b) const {
    double sum = 0.0;
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i)
          sum += static_cast<double>(a[g.padded(i, j, k)]) * static_cast<double>(b[g.padded(i, j, k)]);
    return sum;
  }
};

inline std::vector<PressureCase> pressure_cases(Vec3i cells, double contrast) {
  using grid::Wall;
  constexpr Wall s = Wall::kSlip, n = Wall::kNoSlip, o = Wall::kOpen, p = Wall::kPeriodic;
  return {{"slip", cells, {s, s, s, s, s, s}, contrast},
          {"no-slip", cells, {n, n, n, n, n, n}, contrast},
          {"open", cells, {o, o, o, o, o, o}, contrast},
          {"periodic", cells, {p, p, p, p, p, p}, contrast},
          {"mixed", cells, {p, p, n, o, s, n}, contrast}};
}

inline Eigen::VectorXd to_vector(const PressureCase& c, const std::vector<Real>& cells) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(c.g.cell_count()));
  for (int k = 0; k < c.g.cells[2]; ++k)
    for (int j = 0; j < c.g.cells[1]; ++j)
      for (int i = 0; i < c.g.cells[0]; ++i)
        v[static_cast<Eigen::Index>(c.g.cell(i, j, k))] = static_cast<double>(cells[c.g.padded(i, j, k)]);
  return v;
}

inline void check_symmetric_definite(const PressureCase& c, system::PressureMultigrid& multigrid, double tolerance) {
  const Parallel parallel(1);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const std::vector<Real> r = c.random_cells(seed), s = c.random_cells(seed + 50);
    std::vector<Real> br(r.size(), 0), bs(r.size(), 0);
    multigrid.precondition(parallel, r, br);
    multigrid.precondition(parallel, s, bs);
    const double rr = c.dot(r, br), ss = c.dot(s, bs);
    CHECK(rr > 0.0);
    CHECK(ss > 0.0);
    CHECK(std::abs(c.dot(s, br) - c.dot(r, bs)) < tolerance * std::sqrt(rr * ss));
  }
}

}  // namespace efsi::test
