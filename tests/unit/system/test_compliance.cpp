// Purpose: cells that give way to the pressure: (J W J^T + D) q = b and its multigrid.
#include <catch2/catch.hpp>
#include <cmath>

#include "reference/assembled_constraint.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// D in the cells of a ball in the middle, `share` of what the diagonal of J W J^T is for a density of 1.
std::vector<Real> giving_ball(const PressureCase& c, double share) {
  std::vector<Real> d(c.g.padded_count(), 0);
  const Vec3d center = 0.5 * c.g.h * Vec3d(c.g.cells[0], c.g.cells[1], c.g.cells[2]);
  for (int k = 0; k < c.g.cells[2]; ++k)
    for (int j = 0; j < c.g.cells[1]; ++j)
      for (int i = 0; i < c.g.cells[0]; ++i)
        if ((c.g.cell_center(i, j, k) - center).norm() < 0.25 * c.g.h * c.g.cells[0])
          d[c.g.padded(i, j, k)] = static_cast<Real>(share * 1.5 * c.g.h);
  return d;
}

}  // namespace

TEST_CASE("What cells give way is a diagonal of the assembled matrix, for every kind of wall") {
  for (const double share : {1e-2, 1.0, 100.0})
    for (const PressureCase& c : pressure_cases({8, 10, 8}, 20.0)) {
      INFO(c.name << ", D " << share);
      const std::vector<Real> giving = giving_ball(c, share);
      const reference::AssembledConstraint twin(c.g, c.walls, c.specific_volume);
      Eigen::SparseMatrix<double> a = twin.matrix();
      const Eigen::VectorXd d = to_vector(c, giving);
      for (Eigen::Index i = 0; i < d.size(); ++i) a.coeffRef(i, i) += d[i];
      // A right-hand side that a pressure can meet, its mean included.
      std::vector<Real> exact = c.random_cells(5), b(exact.size(), 0), q(exact.size(), 0);
      const Parallel parallel(1);
      system::PressureMultigrid multigrid;
      multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, nullptr, giving);
      multigrid.apply(parallel, exact, b);
      const Eigen::VectorXd product = a * to_vector(c, exact);
      CHECK((to_vector(c, b) - product).norm() < (sizeof(Real) == 8 ? 1e-13 : 2e-6) * product.norm());
      check_symmetric_definite(c, multigrid, sizeof(Real) == 8 ? 1e-12 : 1e-5);
    }
}

TEST_CASE("Multigrid needs few iterations whatever cells give way", "[law]") {
  for (const double share : {1e-4, 1e-2, 1.0, 100.0})
    for (const double contrast : {0.1, 1.0, 1000.0})
      for (const PressureCase& c : pressure_cases({32, 32, 32}, contrast)) {
        INFO(c.name << ", D " << share << ", density " << contrast);
        const Parallel parallel(1);
        system::PressureSystem system;
        system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, {}, nullptr, false, false,
                        giving_ball(c, share / contrast));
        std::vector<Real> q(c.g.padded_count(), 0);
        const auto before = system.set_right_side(parallel, c.random_velocity(7), {});
        const linalg::SolveStats stats =
            system.solve(parallel, system::PressureSolver::kMultigridPcg, 0.018, before, q);
        INFO(stats.iterations << " iterations");
        CHECK(stats.converged);
        CHECK(stats.iterations <= 10);
      }
}

TEST_CASE("A closed box in which nothing but a ball gives way has the pressure that its source asks for") {
  // The mean of the right-hand side stands in D q alone: what a uniform source brings the ball takes.
  const PressureCase c = pressure_cases({16, 16, 16}, 1.0)[0];
  const std::vector<Real> giving = giving_ball(c, 0.01);
  const Parallel parallel(1);
  system::PressureSystem system;
  system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, {}, nullptr, false, false, giving);
  grid::VectorField v;
  v.assign(c.g.node_count());
  const std::vector<Real> source(c.g.padded_count(), 1);
  std::vector<Real> q(c.g.padded_count(), 0);
  const auto before = system.set_right_side(parallel, v, source);
  CHECK(system.solve(parallel, system::PressureSolver::kMultigridPcg, 1e-4, before, q).converged);
  double taken = 0.0;
  for (std::size_t i = 0; i < q.size(); ++i) taken -= static_cast<double>(giving[i]) * static_cast<double>(q[i]);
  CHECK(taken == Approx(std::pow(c.g.h, 3) * static_cast<double>(c.g.cell_count())).epsilon(1e-3));
}
