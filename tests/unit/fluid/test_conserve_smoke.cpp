// Purpose: smoke is neither made nor lost, by exchange nearby.
#include <catch2/catch.hpp>
#include <cmath>

#include "fluid/advect.hpp"
#include "reference/plain_budget.hpp"
#include "unit/fluid/fields.hpp"

using namespace efsi;
using namespace efsi::fluid;

namespace {

// Closed: it turns in the x, y plane and shears along z; at rest beyond x = reach.
VectorField vortex(const Grid& g, double reach = 1.0) {
  VectorField v;
  v.assign(g.node_count());
  const Vec3d size = g.node_position(g.cells[0], g.cells[1], g.cells[2]);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d p = g.node_position(i, j, k).cwiseQuotient(size);
        const double x = p[0] / reach, fade = std::cos(M_PI * p[2]);
        if (x >= 1.0) continue;
        v.set(g.node(i, j, k), Vec3(Vec3d(reach * size[0] * std::sin(M_PI * x) * std::cos(M_PI * p[1]) * fade,
                                          -size[1] * std::cos(M_PI * x) * std::sin(M_PI * p[1]) * fade, 0.0)
                                        .cast<Real>()));
      }
  return v;
}

// Smoke of density 1 in a box of cells.
std::vector<Real> smoke_in(const Grid& g, const Vec3i& begin, const Vec3i& end) {
  std::vector<Real> smoke(g.cell_count(), Real(0));
  for (int k = begin[2]; k < end[2]; ++k)
    for (int j = begin[1]; j < end[1]; ++j)
      for (int i = begin[0]; i < end[0]; ++i) smoke[g.cell(i, j, k)] = 1;
  return smoke;
}

struct Carried {
  FluidState state;
  AdvectWorkspace work;
  void step(const Parallel& parallel, const Grid& g, const VectorField& v, double dt, const Walls& walls = {}) {
    advect_smoke(parallel, g, true, dt, v, {}, state, work);
    settle_smoke(parallel, g, walls, {}, state, work);
  }
};

}  // namespace

TEST_CASE("Smoke, heat and cold keep their amount within their bounds in a closed box of any size", "[law]") {
  for (const bool periodic : {false, true})
    for (const double cells : {0.4, 3.0}) {  // per step
      const Grid g = box({27, 20, 13}, periodic);
      const VectorField v = vortex(g);
      Carried s;
      s.state.smoke = smoke_in(g, {3, 4, 2}, {12, 15, 11});
      s.state.temperature = s.state.smoke;
      for (Real& t : s.state.temperature) t *= -20;
      const double smoke = total(s.state.smoke), heat = total(s.state.temperature);
      for (int n = 0; n < 60; ++n) {
        s.step(Parallel(1), g, v, cells * g.h);
        const auto [low, high] = std::minmax_element(s.state.smoke.begin(), s.state.smoke.end());
        const auto [cold, warm] = std::minmax_element(s.state.temperature.begin(), s.state.temperature.end());
        REQUIRE((*low >= 0 && *high <= 1 && *cold >= -20 && *warm <= 0));
      }
      INFO("periodic " << periodic << ", " << cells << " cells per step");
      CHECK(total(s.state.smoke) == Approx(smoke).epsilon(2e-3));
      CHECK(total(s.state.temperature) == Approx(heat).epsilon(2e-3));
    }
}

TEST_CASE("What the transport loses is given back nearby, not everywhere") {
  const Grid g = box({80, 24, 24});
  const VectorField v = vortex(g, 0.4);
  Carried s;
  s.state.smoke = smoke_in(g, {4, 4, 4}, {20, 20, 20});
  const std::vector<Real> far = smoke_in(g, {60, 4, 4}, {70, 20, 20});
  const double near = total(s.state.smoke);
  for (std::size_t c = 0; c < far.size(); ++c) s.state.smoke[c] += Real(0.5) * far[c];  // there is room for more
  for (int n = 0; n < 20; ++n) s.step(Parallel(1), g, v, 1.5 * g.h);
  double moved = 0.0, left = 0.0;
  for (std::size_t c = 0; c < far.size(); ++c) {
    const bool at_rest = c % 80 >= 56;
    if (at_rest) moved = std::max(moved, static_cast<double>(std::abs(s.state.smoke[c] - Real(0.5) * far[c])));
    if (!at_rest) left += static_cast<double>(s.state.smoke[c]);
  }
  CHECK(moved < 1e-5);
  CHECK(left == Approx(near).epsilon(2e-3));
}

TEST_CASE("A disc of smoke that has turned once is no further from where it should be than without the exchange") {
  const Grid g = box({48, 48, 4});
  VectorField v;
  v.assign(g.node_count());
  for (int k = 0; k <= 4; ++k)
    for (int j = 0; j <= 48; ++j)
      for (int i = 0; i <= 48; ++i) {
        const Vec3d x = g.node_position(i, j, k);
        v.set(g.node(i, j, k), Vec3(Vec3d(2 * M_PI * (0.5 - x[1]), 2 * M_PI * (x[0] - 0.5), 0.0).cast<Real>()));
      }
  const auto error = [&](bool keep) {
    Carried s;
    s.state.smoke.resize(g.cell_count());
    for (int k = 0; k < 4; ++k)
      for (int j = 0; j < 48; ++j)
        for (int i = 0; i < 48; ++i)
          s.state.smoke[g.cell(i, j, k)] =
              (g.cell_center(i, j, 0) - Vec3d(0.5, 0.7, 0.5 * g.h)).norm() < 0.15 ? Real(1) : Real(0);
    const std::vector<Real> start = s.state.smoke;
    const int steps = 100;
    for (int n = 0; n < steps; ++n) {
      advect_smoke(Parallel(1), g, true, 1.0 / steps, v, {}, s.state, s.work);
      if (keep) settle_smoke(Parallel(1), g, Walls{}, {}, s.state, s.work);
    }
    double sum = 0.0;
    for (std::size_t c = 0; c < start.size(); ++c) sum += static_cast<double>(std::abs(s.state.smoke[c] - start[c]));
    return sum / total(start);
  };
  const double kept = error(true), free = error(false);
  INFO("error " << kept << " and " << free);
  CHECK(kept < free);
}

TEST_CASE("Smoke in a uniform flow goes unchanged through periodic faces") {
  const Grid g = box({40, 28, 19}, true);
  VectorField v;
  v.assign(g.node_count());
  for (std::size_t a = 0; a < 3; ++a) std::fill(v.c[a].begin(), v.c[a].end(), a == 1 ? Real(-2) : Real(1));
  Carried s;
  for (int k = 0; k < 19; ++k)
    for (int j = 0; j < 28; ++j)
      for (int i = 0; i < 40; ++i)
        s.state.smoke.push_back(static_cast<Real>(std::exp(-0.02 * (Vec3d(i, j, k) - Vec3d(20, 14, 9)).squaredNorm())));
  const std::vector<Real> start = s.state.smoke;
  for (int n = 0; n < 5; ++n) s.step(Parallel(1), g, v, g.h);
  double worst = 0.0;
  for (int k = 0; k < 19; ++k)
    for (int j = 0; j < 28; ++j)
      for (int i = 0; i < 40; ++i)
        worst = std::max(
            worst, static_cast<double>(std::abs(start[g.cell(i, j, k)] -
                                                s.state.smoke[g.cell((i + 5) % 40, (j + 18) % 28, (k + 5) % 19)])));
  CHECK(worst < 1e-2);
}

TEST_CASE("Smoke that leaves through an open face does not come back", "[law]") {
  const Grid g = box({16, 32, 16});
  VectorField v;
  v.assign(g.node_count());
  std::fill(v.c[1].begin(), v.c[1].end(), Real(1));
  Walls walls;
  walls.face[3] = grid::Wall::kOpen;
  Carried s;
  s.state.smoke = smoke_in(g, {4, 2, 4}, {12, 12, 12});
  const double start = total(s.state.smoke);
  for (int n = 0; n < 8; ++n) s.step(Parallel(1), g, v, 1.3 * g.h, walls);
  CHECK(total(s.state.smoke) == Approx(start).epsilon(0.02));
  for (int n = 0; n < 22; ++n) s.step(Parallel(1), g, v, 1.3 * g.h, walls);
  CHECK(total(s.state.smoke) < 1e-3 * start);
}

TEST_CASE("A solid that moves displaces smoke and leaves none missing behind it", "[law]") {
  const Grid g = box({32, 16, 16});
  VectorField rest;
  rest.assign(g.node_count());
  const auto solid_at = [&](int x) {
    std::vector<Real> fraction(g.cell_count(), Real(0));
    for (int k = 6; k < 10; ++k)
      for (int j = 6; j < 10; ++j)
        for (int i = x; i < x + 4; ++i) fraction[g.cell(i, j, k)] = Real(0.9);
    return fraction;
  };
  Carried s;
  s.state.smoke.resize(g.cell_count());
  for (std::size_t c = 0; c < s.state.smoke.size(); ++c)
    s.state.smoke[c] = Real(0.4) + Real(0.2) * static_cast<Real>(c % 3);
  std::vector<Real> fraction = solid_at(6);
  for (std::size_t c = 0; c < fraction.size(); ++c)
    if (fraction[c] > 0) s.state.smoke[c] = 0;
  const double start = total(s.state.smoke);
  for (int x = 6; x < 20; ++x) {
    advect_smoke(Parallel(1), g, true, 0.01, rest, fraction, s.state, s.work);
    fraction = solid_at(x + 1);
    settle_smoke(Parallel(1), g, Walls{}, fraction, s.state, s.work);
    for (std::size_t c = 0; c < fraction.size(); ++c)
      if (fraction[c] > 0) REQUIRE(s.state.smoke[c] == 0);
    REQUIRE(*std::max_element(s.state.smoke.begin(), s.state.smoke.end()) <= Real(0.8));
    CHECK(s.state.smoke[g.cell(x, 7, 7)] > Real(0.3));  // behind it
    CHECK(total(s.state.smoke) == Approx(start).epsilon(1e-4));
  }
}

TEST_CASE("The exchange gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const Grid g = box({30, 27, 22});
  const VectorField v = vortex(g);
  std::vector<Real> first;
  for (int threads : {1, 2, 3, 8}) {
    Carried s;
    s.state.smoke = smoke_in(g, {3, 4, 2}, {20, 21, 15});
    for (int n = 0; n < 5; ++n) s.step(Parallel(threads), g, v, 1.5 * g.h);
    if (threads == 1) first = s.state.smoke;
    CHECK(s.state.smoke == first);
  }
}

TEST_CASE("The exchange agrees with its readable twin") {
  for (const bool periodic : {false, true}) {
    const Grid g = box({37, 26, 21}, periodic);
    const VectorField v = vortex(g);
    Carried s;
    s.state.smoke.assign(g.cell_count(), 0);
    for (int k = 0; k < 21; ++k)
      for (int j = 0; j < 26; ++j)
        for (int i = 0; i < 37; ++i)
          s.state.smoke[g.cell(i, j, k)] =
              static_cast<Real>(0.5 + 0.3 * std::sin(0.4 * i) * std::cos(0.5 * j + 0.3 * k));
    for (int k = 4; k < 21; k += 8)  // the same bound everywhere
      for (int j = 4; j < 26; j += 8)
        for (int i = 4; i < 37; i += 8) s.state.smoke[g.cell(i, j, k)] = Real(0.9);
    const std::vector<Real> before = s.state.smoke;
    advect_smoke(Parallel(2), g, true, 2.5 * g.h, v, {}, s.state, s.work);
    const std::vector<Real> twin = reference::kept_scalar(g, before, s.state.smoke, s.work.first);
    const std::vector<Real> carried = s.state.smoke;
    settle_smoke(Parallel(2), g, Walls{}, {}, s.state, s.work);
    double change = 0.0, apart = 0.0;
    for (std::size_t c = 0; c < twin.size(); ++c) {
      change = std::max(change, std::abs(static_cast<double>(s.state.smoke[c] - carried[c])));
      apart = std::max(apart, std::abs(static_cast<double>(s.state.smoke[c] - twin[c])));
    }
    INFO("periodic " << periodic << ": changed by " << change << ", apart by " << apart);
    CHECK(change > 1e-4);
    CHECK(apart < 1e-5);
  }
}
