// Purpose: the constraint stencils against assembled matrices.
#include <catch2/catch.hpp>

#include "reference/assembled_constraint.hpp"
#include "system/divergence.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

system::PressureMultigrid built(const PressureCase& c) {
  system::PressureMultigrid multigrid;
  multigrid.build(Parallel(1), c.g, c.walls, c.fixed, c.specific_volume, {});
  return multigrid;
}

Eigen::VectorXd to_vector(const reference::AssembledConstraint& twin, const grid::VectorField& v) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(twin.j.cols());
  const grid::Grid& g = twin.g;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        for (std::size_t a = 0; a < 3; ++a)
          x[static_cast<Eigen::Index>(3 * twin.own(i, j, k) + a)] = static_cast<double>(v.c[a][g.node(i, j, k)]);
  return x;
}

}  // namespace

TEST_CASE("The matrix-free J W J^T is the assembled one, for every kind of wall") {
  for (const PressureCase& c : pressure_cases({6, 5, 4}, 50.0)) {
    INFO(c.name);
    const reference::AssembledConstraint twin(c.g, c.walls, c.specific_volume);
    const Eigen::SparseMatrix<double> a = twin.matrix();
    system::PressureMultigrid multigrid = built(c);
    std::vector<Real> p = c.random_cells(31), y(p.size(), 0), b = c.random_cells(32), r(p.size(), 0);
    multigrid.apply(Parallel(1), p, y);
    const Eigen::VectorXd expected = a * to_vector(c, p);
    CHECK((to_vector(c, y) - expected).norm() < kRoundOff * expected.norm());
    system::apply_pressure_operator(Parallel(1), multigrid.finest(), p, r, &b);
    CHECK((to_vector(c, r) - (to_vector(c, b) - expected)).norm() < kRoundOff * expected.norm() * 2);
    const Eigen::VectorXd inverse = to_vector(c, multigrid.finest().inverse_diagonal);
    for (Eigen::Index i = 0; i < inverse.size(); ++i)
      CHECK(inverse[i] * a.coeff(i, i) == Approx(a.coeff(i, i) > 0 ? 1.0 : 0.0).epsilon(10 * kRoundOff));
  }
}

TEST_CASE("Residual and relaxation in boxes are those of whole sweeps there and touch nothing else", "[law]") {
  for (const PressureCase& c : pressure_cases({13, 11, 10}, 50.0)) {
    INFO(c.name);
    const system::PressureMultigrid multigrid = built(c);
    std::vector<Real> x = c.random_cells(31), everywhere(x.size(), 0), inside(x.size(), 7), moved = x,
                      from_zero(x.size(), 7), copied(x.size(), 7);
    const std::vector<Real> b = c.random_cells(32), start = x;
    grid::fill_ghosts(c.g, x, Real(0));
    system::apply_pressure_operator(Parallel(1), multigrid.finest(), x, everywhere, &b);
    grid::TileMask mask(c.g.cells);
    for (std::int64_t t = 0; t < mask.count(); ++t) mask.set(t, t % 3 != 1);
    const auto boxes = mask.boxes();
    system::residual_in_boxes(Parallel(3), multigrid.finest(), boxes, b, x, inside);
    system::relax_in_boxes(Parallel(3), multigrid.finest(), boxes, b, Real(0.25), x, moved);
    system::relax_from_zero(Parallel(3), multigrid.finest(), boxes, b, Real(0.25), from_zero);
    system::copy_in_boxes(Parallel(3), c.g, boxes, b, copied);
    std::vector<bool> in_box(x.size(), false);
    for (const auto& [begin, end] : boxes)
      for (int k = begin[2]; k < end[2]; ++k)
        for (int j = begin[1]; j < end[1]; ++j)
          for (int i = begin[0]; i < end[0]; ++i) in_box[c.g.padded(i, j, k)] = true;
    std::size_t wrong = 0, count = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      count += in_box[i];
      wrong += inside[i] != (in_box[i] ? everywhere[i] : Real(7));
      const Real d = multigrid.finest().inverse_diagonal[i];
      wrong += moved[i] != (in_box[i] ? x[i] + Real(0.25) * d * inside[i] : start[i]);
      wrong += from_zero[i] != (in_box[i] ? Real(0.25) * d * b[i] : Real(7));
      wrong += copied[i] != (in_box[i] ? b[i] : Real(7));
    }
    CHECK(wrong == 0);
    CHECK(count > 0);
    CHECK(count < c.g.cell_count());
  }
}

TEST_CASE("Divergence and pressure impulse are J and its transpose") {
  for (const PressureCase& c : pressure_cases({6, 5, 4}, 1.0)) {
    INFO(c.name);
    const reference::AssembledConstraint twin(c.g, c.walls, c.specific_volume);
    const grid::VectorField v = c.random_velocity(33);
    const std::vector<Real> source = c.random_cells(34);
    std::vector<Real> out, less;
    system::compute_flux(Parallel(1), c.g, v, {}, out);
    system::compute_flux(Parallel(1), c.g, v, source, less);
    const double h3 = c.g.h * c.g.h * c.g.h;
    const Eigen::VectorXd flux = twin.j * to_vector(twin, v);
    CHECK((to_vector(c, out) - flux).norm() < kRoundOff * flux.norm());
    const Eigen::VectorXd wanted = h3 * to_vector(c, source);
    CHECK((to_vector(c, less) - (flux - wanted)).norm() < kRoundOff * (flux.norm() + wanted.norm()));

    // <J v, p> = <v, J^T p>
    std::vector<Real> p = c.random_cells(34);
    grid::fill_ghosts(c.g, p, Real(0));
    double right = 0.0, size = 0.0;
    for (int k = 0; k <= c.g.cells[2] - c.g.periodic[2]; ++k)
      for (int j = 0; j <= c.g.cells[1] - c.g.periodic[1]; ++j)
        for (int i = 0; i <= c.g.cells[0] - c.g.periodic[0]; ++i) {
          const Vec3d impulse = system::pressure_impulse(c.g, p, i, j, k).cast<double>();
          const double term = impulse.dot(v.at(c.g.node(i, j, k)).cast<double>());
          right += term;
          size += std::abs(term);
        }
    CHECK(c.dot(out, p) == Approx(right).margin(kRoundOff * size));
  }
}

TEST_CASE("Subtracting the pressure gradient is v - W J^T q") {
  for (const PressureCase& c : pressure_cases({6, 5, 4}, 50.0)) {
    INFO(c.name);
    const reference::AssembledConstraint twin(c.g, c.walls, c.specific_volume);
    const system::PressureMultigrid multigrid = built(c);
    std::vector<Real> q = c.random_cells(35);
    grid::fill_ghosts(c.g, q, Real(0));
    grid::VectorField v = c.random_velocity(36);
    const Eigen::VectorXd before = to_vector(twin, v);
    const Eigen::VectorXd change = twin.w.asDiagonal() * Eigen::VectorXd(twin.j.transpose() * to_vector(c, q));
    system::subtract_pressure_gradient(Parallel(1), multigrid.finest(), q, v);
    CHECK((to_vector(twin, v) - (before - change)).norm() < kRoundOff * (before.norm() + change.norm()));
  }
}

TEST_CASE("A linear velocity has its divergence in every cell, a rotation none") {
  grid::Grid g;
  g.cells = {5, 6, 7};
  g.h = 0.2;
  grid::VectorField expanding, turning;
  expanding.assign(g.node_count());
  turning.assign(g.node_count());
  for (int k = 0; k <= 7; ++k)
    for (int j = 0; j <= 6; ++j)
      for (int i = 0; i <= 5; ++i) {
        const Vec3d x = g.node_position(i, j, k);
        expanding.set(g.node(i, j, k), Vec3(Vec3d(2 * x[0] + x[1], -0.5 * x[1], x[2] - x[0]).cast<Real>()));
        turning.set(g.node(i, j, k), Vec3(Vec3d(-x[1] + x[2], x[0], -x[0]).cast<Real>()));
      }
  std::vector<Real> a, b;
  const double h3 = g.h * g.h * g.h;
  system::compute_flux(Parallel(1), g, expanding, {}, a);
  system::compute_flux(Parallel(1), g, turning, {}, b);
  for (int k = 0; k < 7; ++k)
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 5; ++i) {
        CHECK(static_cast<double>(a[g.padded(i, j, k)]) == Approx(2.5 * h3).epsilon(1e-5));
        CHECK(std::abs(static_cast<double>(b[g.padded(i, j, k)])) < 1e-5 * h3);
      }
}
