// Purpose: transport of the fluid's velocity and of smoke.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "fluid/advect.hpp"
#include "grid/boundary.hpp"
#include "reference/plain_advection.hpp"
#include "system/pressure_solve.hpp"
#include "unit/fluid/fields.hpp"

using namespace efsi;
using namespace efsi::fluid;

namespace {

// A row of vortices in the unit square, the same in every layer: a steady flow of an inviscid fluid.
Vec3d vortex(const Vec3d& x) {
  return {std::sin(M_PI * x[0]) * std::cos(M_PI * x[1]), -std::cos(M_PI * x[0]) * std::sin(M_PI * x[1]), 0.0};
}

template <class F>
VectorField sampled(const Grid& g, const F& f) {
  VectorField v;
  v.assign(g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        v.set(g.node(i, j, k), Vec3(Vec3d(f(g.node_position(i, j, k))).cast<Real>()));
  return v;
}

// A box of fluid with slip walls.
struct Box {
  explicit Box(const Vec3i& cells) : g(box(cells)), fixed(grid::fixed_by_walls(g, walls)) {
    specific_volume.assign(g.node_count(), 1);
    pressure.assemble(parallel, g, walls, fixed, specific_volume, {}, {});
    q.assign(g.padded_count(), 0);
  }
  // A step of an inviscid fluid: projection and transport.
  void step(bool corrected, double dt) {
    VectorField v = state.velocity;
    for (std::size_t m = 0; m < fixed.size(); ++m)
      for (std::size_t a = 0; a < 3; ++a)
        if (fixed[m] & (1u << a)) v.c[a][m] = 0;
    pressure.solve(parallel, system::PressureSolver::kMultigridPcg, 1e-4, pressure.set_right_side(parallel, v, {}), q);
    pressure.project(parallel, q, v);
    advect_velocity(parallel, g, corrected, dt, v, v, specific_volume, Real(1), state, work);
  }
  // Sum of the squares of the velocity.
  double energy() const {
    double sum = 0.0;
    for (std::size_t m = 0; m < g.node_count(); ++m) sum += state.velocity.at(m).cast<double>().squaredNorm();
    return sum;
  }

  const Parallel parallel{1};
  const Grid g;
  const Walls walls;
  const std::vector<std::uint8_t> fixed;
  std::vector<Real> specific_volume, q;
  system::PressureSystem pressure;
  FluidState state;
  AdvectWorkspace work;
};

// Error (root mean square) after half a time unit in a box with slip walls, and the part of the energy that is left.
struct VortexResult {
  double error, energy;
};
VortexResult run_vortex(int n, bool corrected) {
  Box fluid({n, n, 2});
  const VectorField start = sampled(fluid.g, vortex);
  fluid.state.velocity = start;
  const double all = fluid.energy();
  const int steps = n * n / 32;  // the split into transport and projection is first order in time: dt ~ h^2
  for (int s = 0; s < steps; ++s) fluid.step(corrected, 0.5 / steps);
  double error = 0.0;
  for (std::size_t m = 0; m < fluid.g.node_count(); ++m)
    error += (fluid.state.velocity.at(m) - start.at(m)).cast<double>().squaredNorm();
  return {std::sqrt(error / static_cast<double>(fluid.g.node_count())), fluid.energy() / all};
}

// A step of smoke beside solids that do not move.
std::uint64_t carry_smoke(const Parallel& parallel, const Grid& g, bool corrected, double dt, const VectorField& v,
                          const std::vector<Real>& fraction, FluidState& state, AdvectWorkspace& work) {
  const std::uint64_t tiles = advect_smoke(parallel, g, corrected, dt, v, fraction, state, work);
  settle_smoke(parallel, g, Walls{}, fraction, state, work);
  return tiles;
}

}  // namespace

TEST_CASE("Taylor-Green vortices stay as they are, with an error that falls under refinement", "[law]") {
  const VortexResult coarse = run_vortex(16, true), middle = run_vortex(32, true), fine = run_vortex(64, true);
  INFO("errors " << coarse.error << " " << middle.error << " " << fine.error << ", energy " << fine.energy);
  CHECK(fine.error < 0.02);
  CHECK(std::log2(coarse.error / middle.error) > 1.5);
  CHECK(std::log2(middle.error / fine.error) > 1.5);
  CHECK(fine.energy > 0.96);
  CHECK(fine.energy < 1.005);
  // Plain semi-Lagrangian transport loses far more.
  const VortexResult plain = run_vortex(32, false);
  CHECK(plain.error > 1.5 * middle.error);
  CHECK(plain.energy < middle.energy);
}

TEST_CASE("A noisy flow in short steps does not gain energy from what the divergence does not see", "[law]") {
  Box fluid({16, 16, 16});
  fluid.state.velocity = sampled(fluid.g, vortex);
  std::mt19937 random(17);
  for (auto& component : fluid.state.velocity.c)
    for (Real& v : component) v += Real(0.4) * (static_cast<Real>(random() % 1000) / 1000 - Real(0.5));
  fluid.step(true, 0.004);
  const double start = fluid.energy();
  double half = 0.0;
  for (int s = 0; s < 1000; ++s) {
    if (s == 500) half = fluid.energy();
    fluid.step(true, 0.004);  // 0.06 cells
  }
  INFO("energy " << start << ", " << half << ", " << fluid.energy());
  CHECK(fluid.energy() < start);
  CHECK(fluid.energy() < 1.05 * half);
}

TEST_CASE("A jet away from a no-slip wall takes in the fluid at rest there, however long the step", "[law]") {
  const Grid g = box({6, 12, 6});
  for (const double cells : {0.5, 1.5, 4.0}) {  // per step
    FluidState state;
    const VectorField v = sampled(g, [&](const Vec3d& x) { return Vec3d(0, x[1] > 1e-9 ? cells : 0.0, 0); });
    const std::vector<Real> specific_volume(g.node_count(), Real(1));
    AdvectWorkspace work;
    for (const bool corrected : {false, true}) {
      advect_velocity(Parallel(1), g, corrected, g.h, v, v, specific_volume, Real(1), state, work);
      // What was at rest at the wall lies between the first and the second node or beyond them.
      const double first = static_cast<double>(state.velocity.c[1][g.node(3, 1, 3)]);
      INFO(cells << " cells per step: " << first);
      CHECK(first < 0.8 * cells);
      if (cells >= 2.0) CHECK(first == 0.0);
    }
  }
}

TEST_CASE("A uniform flow carries smoke by whole cells exactly, through periodic faces", "[law]") {
  for (const bool corrected : {false, true}) {
    const Grid g = box({20, 18, 16}, true);
    FluidState state;
    state.smoke.assign(g.cell_count(), 0);
    std::mt19937 random(61);
    for (int k = 5; k < 9; ++k)
      for (int j = 5; j < 9; ++j)
        for (int i = 15; i < 19; ++i) state.smoke[g.cell(i, j, k)] = static_cast<Real>(random() % 1000) / 1000;
    const std::vector<Real> start = state.smoke;
    const VectorField v = sampled(g, [](const Vec3d&) { return Vec3d(3, -2, 4); });
    AdvectWorkspace work;
    // Cells per step: 3, -2, 4. Five steps: 15, -10, 20.
    for (int n = 0; n < 5; ++n) CHECK(advect_smoke(Parallel(1), g, corrected, g.h, v, {}, state, work) > 0);
    double worst = 0.0;
    for (int k = 0; k < 16; ++k)
      for (int j = 0; j < 18; ++j)
        for (int i = 0; i < 20; ++i)
          worst = std::max(
              worst, std::abs(static_cast<double>(state.smoke[g.cell((i + 15) % 20, (j + 8) % 18, (k + 4) % 16)]) -
                              static_cast<double>(start[g.cell(i, j, k)])));
    CHECK(worst < 1e-4);
    CHECK(total(state.smoke) == Approx(total(start)).epsilon(1e-4));
  }
}

TEST_CASE("Smoke stays within its bounds and keeps its amount in a vortex", "[law]") {
  const Grid g = box({24, 24, 4});
  const VectorField v = sampled(g, vortex);
  FluidState state;
  state.smoke.assign(g.cell_count(), 0);
  for (int k = 0; k < 4; ++k)
    for (int j = 4; j < 12; ++j)
      for (int i = 4; i < 12; ++i) state.smoke[g.cell(i, j, k)] = (i + j) % 3 ? Real(1) : Real(0.25);
  const double start = total(state.smoke);
  AdvectWorkspace work;
  for (int n = 0; n < 20; ++n) {
    carry_smoke(Parallel(1), g, true, 0.03, v, {}, state, work);
    for (Real s : state.smoke) {
      REQUIRE(s >= 0);
      REQUIRE(s <= 1);
    }
  }
  CHECK(total(state.smoke) == Approx(start).epsilon(1e-3));
}

TEST_CASE("Corrected transport keeps a smooth blob sharper than plain transport") {
  const Grid g = box({32, 32, 2});
  const VectorField v = sampled(g, [](const Vec3d& x) { return Vec3d(0.5 - x[1], x[0] - 0.5, 0.0); });
  const auto top = [&](bool corrected) {
    FluidState state;
    state.smoke.assign(g.cell_count(), 0);
    for (int k = 0; k < 2; ++k)
      for (int j = 0; j < 32; ++j)
        for (int i = 0; i < 32; ++i)
          state.smoke[g.cell(i, j, k)] = static_cast<Real>(
              std::exp(-(g.cell_center(i, j, k) - Vec3d(0.5, 0.7, g.cell_center(0, 0, k)[2])).squaredNorm() / 0.008));
    AdvectWorkspace work;
    for (int n = 0; n < 32; ++n) carry_smoke(Parallel(1), g, corrected, 2.0 * M_PI / 32, v, {}, state, work);
    // One turn: the top is back at its place.
    Real best = 0;
    int at = 0;
    for (int j = 0; j < 32; ++j)
      if (state.smoke[g.cell(16, j, 0)] > best) {
        best = state.smoke[g.cell(16, j, 0)];
        at = j;
      }
    CHECK(std::abs(at - 22) <= 1);
    return static_cast<double>(best);
  };
  const double corrected = top(true), plain = top(false);
  INFO("top " << corrected << " and " << plain);
  CHECK(corrected > 1.3 * plain);
  CHECK(corrected <= 1.0);
}

TEST_CASE("Solid cells hold no smoke, and what is at rest or empty is not visited") {
  const Grid g = box({24, 24, 24});
  FluidState state;
  AdvectWorkspace work;
  VectorField rest = sampled(g, [](const Vec3d&) { return Vec3d(0, 0, 0); });
  const std::vector<Real> specific_volume(g.node_count(), 1);
  state.velocity = rest;
  CHECK(advect_velocity(Parallel(1), g, true, 0.01, rest, rest, specific_volume, Real(1), state, work) == 0);
  CHECK(carry_smoke(Parallel(1), g, true, 0.01, rest, {}, state, work) == 0);  // no smoke in the scene
  state.smoke.assign(g.cell_count(), 0);
  CHECK(carry_smoke(Parallel(1), g, true, 0.01, rest, {}, state, work) == 0);  // none anywhere
  state.smoke.assign(g.cell_count(), 1);
  std::vector<Real> fraction(g.cell_count(), 0);
  fraction[g.cell(12, 12, 12)] = 1;
  fraction[g.cell(12, 13, 12)] = Real(0.4);
  carry_smoke(Parallel(1), g, true, 0.01, rest, fraction, state, work);
  CHECK(state.smoke[g.cell(12, 12, 12)] == 0);
  CHECK(static_cast<double>(state.smoke[g.cell(12, 13, 12)]) == Approx(1.0));
  CHECK(static_cast<double>(state.smoke[g.cell(3, 3, 3)]) == Approx(1.0));
}

TEST_CASE("Transport gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const Grid g = box({20, 20, 20});
  const VectorField v = sampled(g, [](const Vec3d& x) { return Vec3d(std::sin(7 * x[1]), x[2], std::cos(5 * x[0])); });
  const std::vector<Real> specific_volume(g.node_count(), 1);
  FluidState first;
  for (int threads : {1, 2, 3, 8}) {
    FluidState state;
    AdvectWorkspace work;
    state.smoke.resize(g.cell_count());
    for (std::size_t c = 0; c < state.smoke.size(); ++c) state.smoke[c] = static_cast<Real>(c % 13) / 13;
    state.velocity = v;
    carry_smoke(Parallel(threads), g, true, 0.07, v, {}, state, work);
    advect_velocity(Parallel(threads), g, true, 0.07, v, v, specific_volume, Real(1), state, work);
    if (threads == 1) first = state;
    CHECK(state.smoke == first.smoke);
    for (std::size_t a = 0; a < 3; ++a) CHECK(state.velocity.c[a] == first.velocity.c[a]);
  }
}

TEST_CASE("Transport of eight points at once agrees with its readable twin, for short and long ways") {
  const std::pair<bool, double> cases[] = {{false, 0.3}, {true, 0.3}, {false, 0.9}, {false, 2.5}, {true, 2.5}};
  for (const auto& [periodic, cells] : cases) {
    INFO(cells << " cells per step" << (periodic ? ", periodic" : ""));
    const Grid g = box({21, 18, 17}, periodic);
    const VectorField v = sampled(g, [](const Vec3d& x) {
      return Vec3d(std::sin(2 * M_PI * x[1]), std::cos(2 * M_PI * x[2]) - 0.3, std::cos(4 * M_PI * x[0]));
    });
    const double dt = cells * g.h;
    const Real step = static_cast<Real>(cells);
    std::vector<Real> specific_volume(g.node_count(), 1);
    std::vector<std::uint8_t> free(g.node_count(), 1);
    for (std::size_t n = 0; n < free.size(); n += 7) {  // beside a solid
      specific_volume[n] = Real(0.5);
      free[n] = 0;
    }
    FluidState state;
    AdvectWorkspace work;
    state.smoke.resize(g.cell_count());
    for (std::size_t c = 0; c < state.smoke.size(); ++c) state.smoke[c] = static_cast<Real>(c % 13) / 13;
    const std::vector<Real> smoke = reference::carried_scalar(g, v, step, state.smoke);
    const VectorField velocity = reference::carried_velocity(g, v, step, free);
    advect_smoke(Parallel(2), g, true, dt, v, {}, state, work);
    advect_velocity(Parallel(2), g, true, dt, v, v, specific_volume, Real(1), state, work);
    // Where a position lies on a cell's face by less than rounding, the limits may be those of the next cell.
    std::size_t apart = 0;
    for (std::size_t c = 0; c < smoke.size(); ++c) apart += std::abs(state.smoke[c] - smoke[c]) > Real(1e-4);
    for (std::size_t n = 0; n < velocity.size(); ++n)
      apart += (state.velocity.at(n) - velocity.at(n)).norm() > Real(1e-4);
    CHECK(apart <= 5);
  }
}
