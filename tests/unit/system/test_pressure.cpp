// Purpose: preconditioner, pressure solve and projection.
#include <catch2/catch.hpp>
#include <cmath>

#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;
using system::PressureSolver;
using system::PressureSystem;

namespace {

constexpr bool kDouble = sizeof(Real) == 8;

double distance(const grid::VectorField& a, const grid::VectorField& b) {
  double sum = 0.0;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t n = 0; n < a.size(); ++n)
      sum += std::pow(static_cast<double>(a.c[c][n]) - static_cast<double>(b.c[c][n]), 2);
  return std::sqrt(sum);
}

PressureSystem assembled(const PressureCase& c, int threads = 1) {
  PressureSystem system;
  system.assemble(Parallel(threads), c.g, c.walls, c.fixed, c.specific_volume, {}, {});
  return system;
}

// Twice the kinetic energy; periodic copies count twice, which does not matter here.
double energy(const PressureCase& c, const grid::VectorField& v) {
  double sum = 0.0;
  for (std::size_t n = 0; n < v.size(); ++n)
    sum += v.at(n).cast<double>().squaredNorm() / static_cast<double>(c.specific_volume[n]);
  return sum;
}

struct OneCell {
  linalg::SolveStats stats;
  grid::VectorField velocity;
  system::DivergenceNorms after;
};

// What the projection makes of a fluid at rest when div v = 1 is wanted in cell (5, 5, 6) alone.
OneCell project_one_cell(const PressureCase& c, double tolerance) {
  const Parallel parallel(1);
  PressureSystem system = assembled(c);
  OneCell made;
  made.velocity.assign(c.g.node_count());
  std::vector<Real> source(c.g.padded_count(), 0), q(c.g.padded_count(), 0);
  source[c.g.padded(5, 5, 6)] = 1;
  made.stats = system.solve(parallel, PressureSolver::kMultigridPcg, tolerance,
                            system.set_right_side(parallel, made.velocity, source), q);
  system.project(parallel, q, made.velocity);
  made.after = system.norms(parallel, made.velocity, source);
  return made;
}

}  // namespace

TEST_CASE("The preconditioner is symmetric and positive definite, for every kind of wall and odd sizes") {
  for (const Vec3i& cells : {Vec3i{16, 12, 14}, Vec3i{13, 15, 17}})
    for (const PressureCase& c : pressure_cases(cells, 1000.0)) {
      if ((c.g.periodic[0] && cells[0] % 2) || (c.g.periodic[1] && cells[1] % 2)) continue;
      INFO(c.name << " " << cells[0]);
      const Parallel parallel(1);
      system::PressureMultigrid multigrid;
      multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
      check_symmetric_definite(c, multigrid, kDouble ? 1e-12 : 1e-5);
    }
}

TEST_CASE("The preconditioner that smooths a part of the grid is symmetric, for every kind of wall") {
  for (const PressureCase& c : pressure_cases({40, 32, 48}, 1000.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
    std::vector<Real> r(c.g.padded_count(), 0);
    r[c.g.padded(20, 3, 30)] = 1;
    multigrid.focus().follow(parallel, r, 0.01);
    check_symmetric_definite(c, multigrid, kDouble ? 1e-12 : 1e-5);
  }
}

TEST_CASE("What the preconditioner's arrays held before does not matter") {
  for (const PressureCase& c : pressure_cases({40, 32, 48}, 1000.0)) {
    INFO(c.name);
    const Parallel parallel(2);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
    std::vector<Real> r(c.g.padded_count(), 0), clean;
    r[c.g.padded(20, 3, 30)] = 1;
    for (const bool focused : {false, true}) {
      if (focused) multigrid.focus().follow(parallel, r, 0.01);
      multigrid.precondition(parallel, r, clean);
      std::vector<Real> used(r.size(), 7);
      multigrid.scratch().assign(r.size(), 5);
      multigrid.precondition(parallel, r, used);
      CHECK(used == clean);
    }
  }
}

TEST_CASE(
    "A solve that smooths where its residual is ends within the tolerance and nearly as soon as one that smooths all",
    "[law]") {
  for (const PressureCase& c : pressure_cases({40, 32, 48}, 1000.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
    std::vector<Real> bump(c.g.padded_count(), 0), b(bump.size(), 0), q[2];  // a right-hand side that can be met
    for (int k = 24; k < 36; ++k)
      for (int j = 2; j < 14; ++j)
        for (int i = 14; i < 26; ++i) {
          const double square = std::pow(i - 20, 2) + std::pow(j - 8, 2) + std::pow(k - 30, 2);
          bump[c.g.padded(i, j, k)] = static_cast<Real>(std::exp(-0.25 * square));
        }
    multigrid.apply(parallel, bump, b);
    const double size = std::sqrt(c.dot(b, b));
    int iterations[2];
    linalg::SolveOptions options;
    options.tolerance = 0.01;
    for (const bool focused : {false, true}) {
      if (focused) multigrid.focus().follow(parallel, b, options.tolerance * size);
      q[focused].assign(b.size(), 0);
      linalg::PcgWorkspace work;
      const linalg::SolveStats stats = linalg::pcg(
          parallel,
          [&](const std::vector<Real>& x, std::vector<Real>& y) {
            multigrid.apply(parallel, const_cast<std::vector<Real>&>(x), y);
          },
          [&](const std::vector<Real>& r, std::vector<Real>& z) { multigrid.precondition(parallel, r, z); }, b,
          q[focused], options, work);
      CHECK(stats.converged);
      iterations[focused] = stats.iterations;
    }
    CHECK(iterations[1] <= iterations[0] + 2);
  }
}

TEST_CASE("Smooth sources need few iterations in boxes of any shape, closed, open and open at one end", "[law]") {
  using grid::Wall;
  constexpr Wall s = Wall::kSlip, o = Wall::kOpen;
  const std::pair<const char*, std::array<Wall, 6>> walls[] = {
      {"closed", {s, s, s, s, s, s}}, {"open", {o, o, o, o, o, o}}, {"open at one end", {s, o, s, s, s, s}}};
  for (const Vec3i& n : {Vec3i{48, 40, 44}, Vec3i{96, 24, 20}, Vec3i{33, 43, 51}})
    for (const auto& [name, faces] : walls) {
      const PressureCase c(name, n, faces, 1.0);
      PressureSystem system = assembled(c);
      grid::VectorField v;
      v.assign(c.g.node_count());
      std::vector<Real> source(c.g.padded_count(), 0), q(source);
      for (int k = 0; k < n[2]; ++k)
        for (int j = 0; j < n[1]; ++j)
          for (int i = 0; i < n[0]; ++i)
            source[c.g.padded(i, j, k)] = static_cast<Real>(std::cos(4.0 * i / n[0]) + std::sin(5.0 * (j + k) / n[1]));
      const Parallel parallel(1);
      const system::DivergenceNorms before = system.set_right_side(parallel, v, source);
      const auto stats = system.solve(parallel, PressureSolver::kMultigridPcg, kDouble ? 1e-6 : 1e-4, before, q);
      INFO(name << ", " << n[0] << " x " << n[1] << " x " << n[2] << ": " << stats.iterations);
      CHECK(stats.converged);
      CHECK(stats.iterations <= (kDouble ? 9 : 5));
    }
}

TEST_CASE("The focus follows what is left to where it goes", "[law]") {
  // A source that begins in one corner: what cycles leave of it lies at the surface of a heavy ball and at the walls.
  const PressureCase c = pressure_cases({64, 64, 64}, 1000.0)[2];
  const Parallel parallel(1);
  system::PressureMultigrid multigrid;
  multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {});
  std::vector<Real> b(c.g.padded_count(), 0);
  for (int k = 0; k < 16; ++k)
    for (int j = 0; j < 16; ++j)
      for (int i = 0; i < 16; ++i)
        b[c.g.padded(i, j, k)] =
            static_cast<Real>(std::exp(-0.1 * (std::pow(i - 7, 2) + std::pow(j - 7, 2) + std::pow(k - 7, 2))));
  linalg::SolveOptions options;
  options.tolerance = 1e-4;
  const double limit = options.tolerance * std::sqrt(c.dot(b, b));
  const auto iterations = [&](bool follows) {
    multigrid.focus().widen();
    multigrid.focus().follow(parallel, b, limit);
    CHECK_FALSE(multigrid.focus().everywhere());
    std::vector<Real> q(b.size(), 0);
    linalg::PcgWorkspace work;
    return linalg::pcg(
               parallel,
               [&](const std::vector<Real>& x, std::vector<Real>& y) {
                 multigrid.apply(parallel, const_cast<std::vector<Real>&>(x), y);
               },
               [&](const std::vector<Real>& r, std::vector<Real>& z) {
                 if (follows) multigrid.focus().follow(parallel, r, limit);
                 multigrid.precondition(parallel, r, z);
               },
               b, q, options, work)
        .iterations;
  };
  const int still = iterations(false), following = iterations(true);
  INFO("iterations where it stays " << still << ", where it follows " << following);
  CHECK(following <= 6);
  CHECK(2 * following < still);
}

TEST_CASE("Projection leaves a divergence within the tolerance and is idempotent", "[law]") {
  // White noise excites the near-null space of no-slip walls: tighter tolerances stall there.
  const double tolerance = 0.01;
  for (const double contrast : {1.0, 1000.0})
    for (const PressureCase& c : pressure_cases({16, 12, 14}, contrast)) {
      INFO(c.name << ", density ratio " << contrast);
      const Parallel parallel(1);
      PressureSystem system = assembled(c);
      grid::VectorField v = c.random_velocity(41);
      const double energy_before = energy(c, v);
      std::vector<Real> q(c.g.padded_count(), 0);
      const double before = system.norms(parallel, v, {}).all;
      const auto stats =
          system.solve(parallel, PressureSolver::kMultigridPcg, tolerance, system.set_right_side(parallel, v, {}), q);
      CHECK(stats.converged);
      CHECK(stats.residual <= tolerance);
      system.project(parallel, q, v);
      const system::DivergenceNorms after = system.norms(parallel, v, {});
      CHECK(after.all < 2.0 * tolerance * before);
      CHECK(energy(c, v) < energy_before);
      // What walls fix stays fixed.
      for (std::size_t n = 0; n < v.size(); ++n)
        for (std::size_t a = 0; a < 3; ++a)
          if (c.fixed[n] & (1u << a)) REQUIRE(v.c[a][n] == 0);
      // Again: the velocity of a projection stays as it is.
      const grid::VectorField once = v;
      std::fill(q.begin(), q.end(), Real(0));
      system.solve(parallel, PressureSolver::kMultigridPcg, 0.1, system.set_right_side(parallel, v, {}), q);
      system.project(parallel, q, v);
      grid::VectorField zero;
      zero.assign(v.size());
      CHECK(distance(v, once) < 10.0 * tolerance * distance(once, zero));
    }
}

TEST_CASE("Multigrid starts from a guess that helps and drops one that does not") {
  for (const PressureCase& c : pressure_cases({16, 12, 14}, 1000.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    PressureSystem system = assembled(c);
    const grid::VectorField v = c.random_velocity(43);
    const auto solve = [&](std::vector<Real>& q) {
      return system.solve(parallel, PressureSolver::kMultigridPcg, 0.01, system.set_right_side(parallel, v, {}), q);
    };
    std::vector<Real> cold(c.g.padded_count(), 0);
    const auto first = solve(cold);
    // The solution as the guess: an iteration more, nearer to the projection, which has the least energy.
    std::vector<Real> warm = cold;
    const int more = solve(warm).iterations;
    CHECK(more >= 1);
    CHECK(more < first.iterations);
    const auto energy_after = [&](std::vector<Real> q) {
      grid::VectorField projected = v;
      system.project(parallel, q, projected);
      return energy(c, projected);
    };
    CHECK(energy_after(warm) < energy_after(cold));
    // Noise as the guess: the same bits as from zero.
    std::vector<Real> noise = c.random_cells(7);
    for (Real& value : noise) value *= Real(1000);
    CHECK(solve(noise).iterations == first.iterations);
    CHECK(noise == cold);
  }
}

TEST_CASE("The tolerance may count from a divergence that was there before") {
  for (const PressureCase& c : pressure_cases({16, 12, 14}, 1000.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    PressureSystem system = assembled(c);
    grid::VectorField v = c.random_velocity(43);
    const system::DivergenceNorms now = system.norms(parallel, v, {}), before{20.0 * now.all, 0.0};
    std::vector<Real> own(c.g.padded_count(), 0), less = own;
    const auto all =
        system.solve(parallel, PressureSolver::kMultigridPcg, 0.01, system.set_right_side(parallel, v, {}), own);
    const auto stats = system.solve(parallel, PressureSolver::kMultigridPcg, 0.01, before, less);
    CHECK(stats.converged);
    CHECK(stats.iterations < all.iterations);
    system.project(parallel, less, v);
    CHECK(system.norms(parallel, v, {}).all < 1.1 * 0.01 * before.all);
  }
}

TEST_CASE("A step along an estimate goes as far as conjugate gradients do") {
  for (const PressureCase& c : pressure_cases({16, 12, 14}, 100.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    PressureSystem system = assembled(c);
    const grid::VectorField start = c.random_velocity(44);
    std::vector<Real> q;
    system.set_right_side(parallel, start, {});
    CHECK(system.estimate(parallel, 1e-3, q).converged);
    for (const double part : {0.25, 1.0, 3.0}) {
      std::vector<Real> longer = q;
      for (Real& value : longer) value *= static_cast<Real>(part);
      grid::VectorField v = start;
      system.project(parallel, longer, v);
      CHECK(system.step_length(parallel, v, {}, longer) == Approx(1.0 / part).epsilon(0.01));
    }
    std::vector<Real> nothing(q.size(), 0);
    CHECK(system.step_length(parallel, start, {}, nothing) == 0.0);
  }
}

TEST_CASE("Both pressure solvers give the same velocity") {
  const double tolerance = kDouble ? 1e-7 : 1e-4;
  for (const PressureCase& c : pressure_cases({10, 10, 10}, 20.0)) {
    INFO(c.name);
    const Parallel parallel(1);
    PressureSystem system = assembled(c);
    const grid::VectorField start = c.random_velocity(42);
    grid::VectorField result[2] = {start, start};
    for (int s = 0; s < 2; ++s) {
      std::vector<Real> q(c.g.padded_count(), 0);
      system.solve(parallel, s ? PressureSolver::kPcr : PressureSolver::kMultigridPcg, tolerance,
                   system.set_right_side(parallel, start, {}), q);
      system.project(parallel, q, result[s]);
    }
    CHECK(distance(result[0], result[1]) < 0.01 * distance(start, result[0]));
  }
}

TEST_CASE("A wanted divergence is met; in a closed box its mean is taken off", "[law]") {
  const double tolerance = kDouble ? 1e-8 : 1e-4;
  for (const PressureCase& c : pressure_cases({12, 10, 14}, 10.0)) {
    // One cell alone is out of reach where checkerboards of pressure move nothing: periodic and no-slip boxes.
    if (c.name != "slip" && c.name != "open") continue;
    INFO(c.name);
    const OneCell made = project_one_cell(c, tolerance);
    CHECK(made.stats.converged);
    std::vector<Real> divergence;
    system::compute_flux(Parallel(1), c.g, made.velocity, {}, divergence);
    for (Real& value : divergence) value /= static_cast<Real>(c.g.h * c.g.h * c.g.h);
    const double mean = c.walls.any_open() ? 0.0 : 1.0 / static_cast<double>(c.g.cell_count());
    CHECK(static_cast<double>(divergence[c.g.padded(5, 5, 6)]) == Approx(1.0 - mean).margin(5 * tolerance));
    CHECK(static_cast<double>(divergence[c.g.padded(2, 3, 4)]) == Approx(-mean).margin(5 * tolerance));
  }
}

TEST_CASE("Of a source out of reach the projection leaves that part and little more, and says so", "[law]") {
  // Pressures (-1)^(i+j) f(k), and the same along the other axes, move nothing in periodic and no-slip boxes: no
  // velocity has a divergence in one cell alone.
  for (const PressureCase& c : pressure_cases({12, 10, 14}, 10.0)) {
    if (c.name != "periodic" && c.name != "no-slip") continue;
    const Vec3d n(c.g.cells[0], c.g.cells[1], c.g.cells[2]);
    const double left = std::sqrt((n.sum() - 2.0) / n.prod());  // of 1; the checkerboard is in all three
    const OneCell made = project_one_cell(c, 1e-4);
    const double after = made.after.all;
    INFO(c.name << ": " << made.stats.iterations << " iterations, says " << made.stats.residual << ", left " << after
                << " of " << left);
    CHECK_FALSE(made.stats.converged);
    CHECK(after > 0.99 * left);
    CHECK(after < 1.2 * left);
  }
}

TEST_CASE("Cells without an equation have no pressure and are left alone") {
  using grid::Wall;
  constexpr Wall s = Wall::kSlip;
  PressureCase c("vacuum", {14, 14, 14}, {s, s, s, s, s, s}, 1.0);
  std::vector<std::uint8_t> active(c.g.padded_count(), 0);
  for (int k = 4; k < 10; ++k)
    for (int j = 4; j < 10; ++j)
      for (int i = 4; i < 10; ++i) active[c.g.padded(i, j, k)] = 1;
  std::fill(c.specific_volume.begin(), c.specific_volume.end(), Real(0));
  for (int k = 4; k <= 10; ++k)
    for (int j = 4; j <= 10; ++j)
      for (int i = 4; i <= 10; ++i) c.specific_volume[c.g.node(i, j, k)] = 1;
  const Parallel parallel(1);
  PressureSystem system;
  system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, active, active);
  grid::VectorField v = c.random_velocity(43);
  const grid::VectorField start = v;
  std::vector<Real> q(c.g.padded_count(), 0), divergence;
  const double tolerance = kDouble ? 1e-8 : 1e-4;
  const system::DivergenceNorms before = system.norms(parallel, v, {});
  CHECK(system.solve(parallel, PressureSolver::kMultigridPcg, tolerance, system.set_right_side(parallel, v, {}), q)
            .converged);
  system.project(parallel, q, v);
  const system::DivergenceNorms after = system.norms(parallel, v, {});
  CHECK(after.solid < 2.0 * tolerance * before.solid);
  CHECK(after.all == Approx(after.solid));
  for (int i = 0; i < 14; ++i)
    if (i < 4 || i >= 10) CHECK(q[c.g.padded(i, 6, 6)] == 0);
  CHECK(v.at(c.g.node(1, 2, 3)) == start.at(c.g.node(1, 2, 3)));
  // Neither do they keep one of the last step.
  std::vector<Real> last = q;
  for (int i = 10; i < 14; ++i) last[c.g.padded(i, 6, 6)] = 5;
  grid::VectorField again = start;
  system.solve(parallel, PressureSolver::kMultigridPcg, tolerance, system.set_right_side(parallel, again, {}), last);
  for (int i = 10; i < 14; ++i) CHECK(last[c.g.padded(i, 6, 6)] == 0);
}

TEST_CASE("Multigrid needs few iterations whatever the density ratio") {
  using grid::Wall;
  constexpr Wall s = Wall::kSlip;
  for (const double contrast : {1.0, 1e3, 1e-3}) {
    PressureCase c("slip", {32, 28, 32}, {s, s, s, s, s, s}, contrast);
    const Parallel parallel(1);
    PressureSystem system = assembled(c);
    const grid::VectorField v = c.random_velocity(44);
    std::vector<Real> q(c.g.padded_count(), 0);
    const auto stats =
        system.solve(parallel, PressureSolver::kMultigridPcg, 0.015, system.set_right_side(parallel, v, {}), q);
    INFO("density ratio " << contrast << ": " << stats.iterations);
    CHECK(stats.converged);
    CHECK(stats.iterations <= 20);
  }
}

TEST_CASE("The pressure solve gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const PressureCase c = pressure_cases({16, 12, 14}, 1000.0)[4];
  const grid::VectorField start = c.random_velocity(45);
  std::vector<Real> first;
  for (int threads : {1, 2, 3, 8}) {
    const Parallel parallel(threads);
    PressureSystem system = assembled(c, threads);
    std::vector<Real> q(c.g.padded_count(), 0);
    grid::VectorField v = start;
    system.solve(parallel, PressureSolver::kMultigridPcg, 1e-3, system.set_right_side(parallel, v, {}), q);
    system.project(parallel, q, v);
    q.insert(q.end(), v.c[0].begin(), v.c[0].end());
    if (first.empty()) first = q;
    CHECK(q == first);
  }
}

TEST_CASE("A grid of another size is solved as by a system that never saw the first") {
  const Parallel parallel(2);
  PressureSystem used;
  for (const Vec3i& cells : {Vec3i{24, 20, 16}, Vec3i{20, 16, 24}, Vec3i{16, 24, 16}}) {
    const PressureCase c = pressure_cases(cells, 1000.0).front();
    const auto solved = [&](PressureSystem& system) {
      system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, {});
      grid::VectorField v = c.random_velocity(7);
      std::vector<Real> q(c.g.padded_count(), 0);
      const system::DivergenceNorms before = system.set_right_side(parallel, v, {});
      CHECK(system.solve(parallel, PressureSolver::kMultigridPcg, 1e-3, before, q).converged);
      return q;
    };
    PressureSystem fresh;
    INFO(c.name << " " << cells[0] << " " << cells[1] << " " << cells[2]);
    CHECK(solved(used) == solved(fresh));
  }
}
