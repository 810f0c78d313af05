// Purpose: pockets that what moves as given shuts off: who belongs together, who is sealed, and that solves end.
#include <algorithm>

#include "system/sealed_parts.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// Cells that share a node at which something moves, one node after the other: part per padded cell, 0: no equation.
std::vector<int> plain_parts(const PressureCase& c, const system::PressureLevel& level) {
  const grid::Grid& g = c.g;
  std::vector<int> part(g.padded_count(), 0);
  int count = 0;
  const auto for_cells = [&](const auto& body) {
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i)
          if (level.active[g.padded(i, j, k)]) body(i, j, k);
  };
  for_cells([&](int i, int j, int k) { part[g.padded(i, j, k)] = ++count; });
  for (bool changed = true; changed;) {
    changed = false;
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t n = g.node(i, j, k);
          if (!(level.mobility[n] > 0) || c.fixed[n] == 7) continue;
          std::vector<std::size_t> around;
          for (const auto& a : grid::kCorner) {
            int q[3] = {i - a[0], j - a[1], k - a[2]};
            bool inside = true;
            for (std::size_t axis = 0; axis < 3; ++axis) {
              if (g.periodic[axis]) q[axis] = (q[axis] + g.cells[axis]) % g.cells[axis];
              inside = inside && q[axis] >= 0 && q[axis] < g.cells[axis];
            }
            if (inside && level.active[g.padded(q[0], q[1], q[2])]) around.push_back(g.padded(q[0], q[1], q[2]));
          }
          int least = count;
          for (const std::size_t cell : around) least = std::min(least, part[cell]);
          for (const std::size_t cell : around) {
            changed = changed || part[cell] != least;
            part[cell] = least;
          }
        }
  }
  return part;
}

system::PressureLevel level_of(const PressureCase& c, std::vector<std::uint8_t> active) {
  system::PressureMultigrid multigrid;
  multigrid.build(Parallel(1), c.g, c.walls, c.fixed, c.specific_volume, std::move(active));
  return multigrid.finest();
}

}  // namespace

TEST_CASE("Sealed parts lose their mean and others nothing, whatever moves; the plain search says the same") {
  std::size_t sealed_parts = 0, open_parts = 0;
  for (const Vec3i& cells : {Vec3i{9, 7, 8}, Vec3i{12, 8, 10}})
    for (const double blocked : {0.5, 0.75, 0.85})
      for (PressureCase& c : pressure_cases(cells, 10.0)) {
        std::mt19937 random(static_cast<unsigned>(1000 * blocked));
        std::uniform_real_distribution<double> part_of_one;
        for (int k = 0; k <= cells[2]; ++k)
          for (int j = 0; j <= cells[1]; ++j)
            for (int i = 0; i <= cells[0]; ++i) {
              int q[3] = {i, j, k};
              for (std::size_t a = 0; a < 3; ++a)
                if (c.g.periodic[a]) q[a] %= cells[a];
              const std::size_t own = c.g.node(q[0], q[1], q[2]), n = c.g.node(i, j, k);
              if (own != n)
                c.specific_volume[n] = c.specific_volume[own];
              else if (part_of_one(random) < blocked)
                c.specific_volume[n] = 0;
            }
        std::vector<std::uint8_t> active(c.g.padded_count(), 1);
        for (std::uint8_t& cell : active) cell = part_of_one(random) < 0.8;
        const system::PressureLevel level = level_of(c, active);
        std::vector<std::uint8_t> moves(c.g.node_count());
        for (std::size_t n = 0; n < moves.size(); ++n) moves[n] = level.mobility[n] > 0 && c.fixed[n] != 7;
        const auto apply = [&](const std::vector<Real>& x, std::vector<Real>& y) {
          std::vector<Real> filled = x;
          grid::fill_ghosts(c.g, filled, Real(0));
          system::apply_pressure_operator(Parallel(1), level, filled, y);
        };
        const std::vector<int> part = plain_parts(c, level);
        std::vector<Real> one(part.size(), 0), moved(part.size(), 0);
        for (std::size_t cell = 0; cell < part.size(); ++cell) one[cell] = part[cell] ? Real(1) : Real(0);
        apply(one, moved);
        const std::vector<Real> before = c.random_cells(7);
        std::vector<Real> after[2] = {before, before};
        for (const int threads : {1, 3}) {
          system::SealedParts parts;
          parts.find(Parallel(threads), level, moves, apply);
          parts.subtract_means(Parallel(threads), after[threads > 1]);
        }
        CHECK(after[0] == after[1]);
        for (int p = 1; p <= *std::max_element(part.begin(), part.end()); ++p) {
          double sum = 0.0, count = 0.0, changed = 0.0;
          bool sealed = true;
          for (std::size_t cell = 0; cell < part.size(); ++cell) {
            if (part[cell] != p) continue;
            sealed = sealed && static_cast<double>(std::abs(moved[cell]) * level.inverse_diagonal[cell]) < 1e-4;
            sum += static_cast<double>(after[0][cell]);
            count += 1.0;
            changed = std::max(changed, static_cast<double>(std::abs(after[0][cell] - before[cell])));
          }
          if (count == 0.0) continue;
          ++(sealed ? sealed_parts : open_parts);
          INFO(c.name << " part of " << count << " cells, sealed " << sealed);
          if (sealed)
            CHECK(std::abs(sum) < 1e-5 * count);
          else
            CHECK(changed == 0.0);
        }
      }
  CHECK(sealed_parts > 100);
  CHECK(open_parts > 20);
}

TEST_CASE(
    "A solve ends where a pocket is squeezed: what flows in is spread over it, and the rest is free of divergence",
    "[law]") {
  const Parallel parallel(1);
  for (PressureCase& c : pressure_cases({16, 12, 14}, 1000.0)) {
    if (c.g.periodic[0]) continue;
    std::vector<std::uint8_t> active(c.g.padded_count(), 1);
    grid::VectorField velocity;
    velocity.assign(c.g.node_count());
    for (int k = 0; k <= c.g.cells[2]; ++k)
      for (int j = 0; j <= c.g.cells[1]; ++j)
        for (int i = 5; i <= 6; ++i) {
          c.specific_volume[c.g.node(i, j, k)] = 0;
          velocity.c[0][c.g.node(i, j, k)] = Real(0.3);
        }
    for (int k = 0; k < c.g.cells[2]; ++k)
      for (int j = 0; j < c.g.cells[1]; ++j) active[c.g.padded(5, j, k)] = 0;
    system::PressureSystem system;
    system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, active, {}, nullptr, true);
    std::vector<Real> q(c.g.padded_count(), 0);
    const auto before = system.set_right_side(parallel, velocity, {});
    const auto stats = system.solve(parallel, system::PressureSolver::kMultigridPcg, 1e-3, before, q);
    INFO(c.name << ": " << stats.iterations << " iterations, residual " << stats.residual);
    CHECK(stats.converged);
    CHECK(stats.iterations < 30);
    system.project(parallel, q, velocity);
    double fastest = 0.0;
    for (const auto& component : velocity.c)
      for (const Real v : component) fastest = std::max(fastest, static_cast<double>(std::abs(v)));
    CHECK(fastest < 3.0);
  }
}
