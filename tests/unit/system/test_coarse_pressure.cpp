// Purpose: the pressure operator of the coarse levels against its definition, and what it is made for.
#include <catch2/catch.hpp>
#include <cmath>

#include "system/coarse_pressure.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr std::array<double, 3> kWhole{1, 1, 1};

system::CoarsePressureLevel coarse_level(const PressureCase& c, std::vector<std::uint8_t> active = {},
                                         const std::array<double, 3>& outer = kWhole) {
  system::CoarsePressureLevel level;
  level.outer = outer;
  level.grid = c.g;
  level.walls = c.walls;
  level.active = std::move(active);
  system::build_coarse_pressure(Parallel(1), c.specific_volume, level);
  return level;
}

// -sum over the faces of a cell of area / density times the pressure's slope, by the definition, in double precision.
// outer: lengths of the cells at walls, from half a cell within their centers.
double plain_product(const PressureCase& c, const std::vector<std::uint8_t>& active, const std::array<double, 3>& outer,
                     const std::vector<Real>& x, Vec3i cell, double* diagonal) {
  const grid::Grid& g = c.g;
  const auto at = [&](const Vec3i& p) { return static_cast<double>(x[g.padded(p[0], p[1], p[2])]); };
  double sum = 0.0;
  *diagonal = 0.0;
  for (std::size_t a = 0; a < 3; ++a)
    for (const int side : {0, 1}) {
      Vec3i face = cell, neighbour = cell;
      face[a] += side;
      neighbour[a] += side ? 1 : -1;
      const bool outside = neighbour[a] < 0 || neighbour[a] >= g.cells[a];
      double distance = g.h, pressure = 0.0;
      if (outside && g.periodic[a]) {
        neighbour[a] = (neighbour[a] + g.cells[a]) % g.cells[a];
      } else if (outside) {
        if (grid::Walls::blocks(c.walls.face[2 * a + static_cast<std::size_t>(side)])) continue;
        distance = (outer[a] - 0.5) * g.h;
      }
      if ((!outside || g.periodic[a]) && (active.empty() || active[g.padded(neighbour[0], neighbour[1], neighbour[2])]))
        pressure = at(neighbour);
      double volume = 0.0;
      for (int corner = 0; corner < 4; ++corner) {
        Vec3i node = face;
        node[(a + 1) % 3] += corner & 1;
        node[(a + 2) % 3] += corner >> 1;
        volume += 0.25 * static_cast<double>(c.specific_volume[g.node(node[0], node[1], node[2])]);
      }
      double area = 1.0;
      for (const std::size_t b : {(a + 1) % 3, (a + 2) % 3})
        area *= g.h * (cell[b] == 0 || cell[b] + 1 == g.cells[b] ? outer[b] : 1.0);
      const double flux = area * volume / distance;
      sum += flux * (at(cell) - pressure);
      *diagonal += flux;
    }
  return sum;
}

}  // namespace

TEST_CASE("The coarse pressure operator is the sum over faces, for every kind of wall and with cells left out") {
  for (const bool masked : {false, true})
    for (const PressureCase& c : pressure_cases({6, 5, 4}, 50.0)) {
      INFO(c.name << (masked ? ", masked" : ""));
      std::vector<std::uint8_t> active;
      if (masked) {
        active.assign(c.g.padded_count(), 1);
        for (int j = 1; j < 4; ++j) active[c.g.padded(2, j, 1)] = active[c.g.padded(5, j, 3)] = 0;
      }
      std::array<double, 3> outer{0.75, 0.625, 1.0};
      for (std::size_t a = 0; a < 3; ++a)
        if (c.g.periodic[a]) outer[a] = 1.0;
      const system::CoarsePressureLevel level = coarse_level(c, active, outer);
      std::vector<Real> x = c.random_cells(31), b = c.random_cells(32), r(x.size(), 0), y(x.size(), 0);
      for (std::size_t n = 0; n < active.size(); ++n)
        if (!active[n]) x[n] = 0;
      grid::fill_ghosts(c.g, x, Real(0));
      const Real weight = Real(0.7);
      system::coarse_residual(Parallel(1), level, b, x, r);
      system::smooth_coarse(Parallel(2), level, b, weight, x, y);
      for (int k = 0; k < c.g.cells[2]; ++k)
        for (int j = 0; j < c.g.cells[1]; ++j)
          for (int i = 0; i < c.g.cells[0]; ++i) {
            const std::size_t n = c.g.padded(i, j, k);
            double diagonal = 0.0;
            double left = static_cast<double>(b[n]) - plain_product(c, active, outer, x, {i, j, k}, &diagonal);
            if (!active.empty() && !active[n]) left = 0.0;
            const double size = std::abs(left) + std::abs(static_cast<double>(b[n])) + 10 * diagonal;
            CHECK(static_cast<double>(r[n]) == Approx(left).margin(kRoundOff * size));
            const double next = static_cast<double>(x[n]) + static_cast<double>(weight) * left / diagonal;
            CHECK(static_cast<double>(y[n]) == Approx(next).margin(kRoundOff * (std::abs(next) + size / diagonal)));
          }
    }
}

TEST_CASE("On smooth pressures the operator by faces and J W J^T are one, to second order", "[law]") {
  double difference[2];
  for (const int refined : {0, 1}) {
    const int n = refined ? 32 : 16;
    const PressureCase c = pressure_cases({n, n, n}, 1.0)[3];
    const system::CoarsePressureLevel level = coarse_level(c);
    system::PressureMultigrid multigrid;
    multigrid.build(Parallel(1), c.g, c.walls, c.fixed, c.specific_volume, {});
    std::vector<Real> x(c.g.padded_count(), 0), zero(x.size(), 0), fine(x.size(), 0), faces(x.size(), 0);
    const double wave = 2.0 * std::acos(-1.0) / n;
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
          x[c.g.padded(i, j, k)] =
              static_cast<Real>(std::cos(wave * i) * std::sin(wave * j) + std::cos(wave * (i + j + k)));
    multigrid.apply(Parallel(1), x, fine);
    system::coarse_residual(Parallel(1), level, zero, x, faces);
    const Eigen::VectorXd a = to_vector(c, fine), b = -to_vector(c, faces);
    difference[refined] = (a - b).norm() / a.norm();
  }
  CHECK(difference[0] < 0.1);
  CHECK(difference[1] < difference[0] / 3.5);
}

TEST_CASE("V-cycles by themselves converge: no correction from a coarse grid overshoots", "[law]") {
  for (const double contrast : {1.0, 1000.0})
    for (const PressureCase& c : pressure_cases({32, 32, 32}, contrast)) {
      INFO(c.name << ", density ratio " << contrast);
      const Parallel parallel(1);
      system::PressureMultigrid multigrid;
      multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
      // What makes an error: a right-hand side that can be met.
      std::vector<Real> exact(c.g.padded_count(), 0), b(exact.size(), 0);
      for (int k = 0; k < 32; ++k)
        for (int j = 0; j < 32; ++j)
          for (int i = 0; i < 32; ++i)
            exact[c.g.padded(i, j, k)] =
                static_cast<Real>(std::exp(-0.02 * (std::pow(i - 13, 2) + std::pow(j - 16, 2) + std::pow(k - 20, 2))));
      multigrid.apply(parallel, exact, b);
      std::vector<Real> x(b.size(), 0), product(b.size(), 0), r = b, z(b.size(), 0);
      for (int cycle = 0; cycle < 6; ++cycle) {
        multigrid.precondition(parallel, r, z);
        for (std::size_t n = 0; n < x.size(); ++n) x[n] += z[n];
        multigrid.apply(parallel, x, product);
        for (std::size_t n = 0; n < x.size(); ++n) r[n] = b[n] - product[n];
      }
      CHECK(c.dot(r, r) < 1e-6 * c.dot(b, b));
    }
}

TEST_CASE("V-cycles converge as fast beside open walls as beside slip walls", "[law]") {
  // What a cycle leaves of the residual, in the mean of six; all of it begins in a corner.
  const auto left_by_cycle = [](const PressureCase& c) {
    const Parallel parallel(1);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
    const Vec3i& n = c.g.cells;
    std::vector<Real> b(c.g.padded_count(), 0);
    double sum = 0.0;
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i) {
          const double value = std::exp(-0.05 * (i * i + j * j + k * k));
          b[c.g.padded(i, j, k)] = static_cast<Real>(value);
          sum += value;
        }
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i)
          if (!c.walls.any_open())
            b[c.g.padded(i, j, k)] -= static_cast<Real>(sum / static_cast<double>(c.g.cell_count()));
    std::vector<Real> x(b.size(), 0), product(b.size(), 0), r = b, z(b.size(), 0);
    for (int cycle = 0; cycle < 6; ++cycle) {
      multigrid.precondition(parallel, r, z);
      for (std::size_t m = 0; m < x.size(); ++m) x[m] += z[m];
      multigrid.apply(parallel, x, product);
      for (std::size_t m = 0; m < x.size(); ++m) r[m] = b[m] - product[m];
    }
    return std::pow(c.dot(r, r) / c.dot(b, b), 1.0 / 12.0);
  };
  for (const Vec3i& cells : {Vec3i{32, 32, 32}, Vec3i{33, 35, 31}}) {
    const std::vector<PressureCase> cases = pressure_cases(cells, 1.0);
    const double slip = left_by_cycle(cases[0]), open = left_by_cycle(cases[2]);
    INFO(cells[0] << " cells: slip " << slip << ", open " << open);
    CHECK(slip < 0.2);
    CHECK(open < 1.1 * slip);
  }
}

TEST_CASE("Coarse corrections leave next to nothing at open walls that nobody smooths", "[law]") {
  const PressureCase c = pressure_cases({64, 64, 64}, 1.0)[2];
  const Parallel parallel(1);
  system::PressureMultigrid multigrid;
  multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
  std::vector<Real> b(c.g.padded_count(), 0), z(b), product(b);
  for (int k = 24; k < 40; ++k)
    for (int j = 24; j < 40; ++j)
      for (int i = 24; i < 40; ++i)
        b[c.g.padded(i, j, k)] =
            static_cast<Real>(std::exp(-0.1 * (std::pow(i - 31, 2) + std::pow(j - 32, 2) + std::pow(k - 32, 2))));
  multigrid.focus().follow(parallel, b, 0.01 * std::sqrt(c.dot(b, b)));
  REQUIRE_FALSE(multigrid.focus().everywhere());
  multigrid.precondition(parallel, b, z);
  multigrid.apply(parallel, z, product);
  const auto outer = [&](int i, int n) { return i < 2 || i >= n - 2; };
  double left = 0.0;
  for (int k = 0; k < 64; ++k)
    for (int j = 0; j < 64; ++j)
      for (int i = 0; i < 64; ++i)
        if (outer(i, 64) || outer(j, 64) || outer(k, 64))
          left += std::pow(static_cast<double>(product[c.g.padded(i, j, k)]), 2);
  CHECK(std::sqrt(left / c.dot(b, b)) < 0.001);
}
