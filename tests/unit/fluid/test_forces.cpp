// Purpose: buoyancy and vorticity confinement.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "fluid/forces.hpp"

using namespace efsi;
using namespace efsi::fluid;

namespace {

struct Scene {
  Grid g;
  FluidParams params;
  FluidState state;
  VectorField velocity;
  std::vector<Real> specific_volume;
  Scene() {
    g.cells = {10, 10, 10};
    g.h = 0.1;
    state.smoke.assign(g.cell_count(), 0);
    state.temperature.assign(g.cell_count(), 0);
    velocity.assign(g.node_count());
    specific_volume.assign(g.node_count(), 1);
  }
  std::uint64_t push(double dt) {
    return add_body_forces(Parallel(1), g, params, state, {0, -9.8, 0}, dt, specific_volume, velocity);
  }
};

}  // namespace

TEST_CASE("Buoyancy: smoke sinks, heat rises, in proportion", "[law]") {
  Scene s;
  std::fill(s.state.smoke.begin(), s.state.smoke.end(), Real(0.5));
  std::fill(s.state.temperature.begin(), s.state.temperature.end(), Real(20));
  CHECK(s.push(0.1) == 0);  // both switched off
  s.params.smoke_buoyancy = 3.0;
  CHECK(s.push(0.1) > 0);
  CHECK(static_cast<double>(s.velocity.c[1][s.g.node(5, 5, 5)]) == Approx(-0.1 * 3.0 * 0.5));
  s.velocity.assign(s.g.node_count());
  s.params.smoke_buoyancy = 0.0;
  s.params.temperature_buoyancy = 0.2;
  s.push(0.1);
  CHECK(static_cast<double>(s.velocity.c[1][s.g.node(5, 5, 5)]) == Approx(0.1 * 0.2 * 20.0));
  CHECK(s.velocity.c[0][s.g.node(5, 5, 5)] == 0);
  // Nodes of a solid are left alone.
  s.velocity.assign(s.g.node_count());
  s.specific_volume[s.g.node(5, 5, 5)] = Real(0.001);
  s.push(0.1);
  CHECK(s.velocity.c[1][s.g.node(5, 5, 5)] == 0);
}

TEST_CASE("Vorticity confinement spins a vortex up and leaves a rigid turn alone") {
  Scene s;
  s.params.vorticity_confinement = 2.0;
  const auto set = [&](const auto& speed) {
    for (int k = 0; k <= 10; ++k)
      for (int j = 0; j <= 10; ++j)
        for (int i = 0; i <= 10; ++i) {
          const Vec3d x = s.g.node_position(i, j, k) - Vec3d::Constant(0.5);
          const double r = std::hypot(x[0], x[1]);
          s.velocity.set(s.g.node(i, j, k), Vec3(Vec3d(-x[1], x[0], 0).cast<Real>() * static_cast<Real>(speed(r))));
        }
  };
  const auto circulation = [&] {
    double sum = 0.0;
    for (int j = 3; j <= 7; ++j)
      for (int i = 3; i <= 7; ++i) {
        const Vec3d x = s.g.node_position(i, j, 5) - Vec3d::Constant(0.5),
                    v = s.velocity.at(s.g.node(i, j, 5)).cast<double>();
        sum += x[0] * v[1] - x[1] * v[0];
      }
    return sum;
  };
  set([](double r) { return std::exp(-r * r / 0.05); });
  const double before = circulation();
  s.push(0.05);
  CHECK(circulation() > before);
  CHECK(circulation() < 2.0 * before);
  set([](double) { return 1.0; });
  const VectorField turning = s.velocity;
  s.push(0.05);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t n = 0; n < turning.size(); ++n)
      REQUIRE(std::abs(s.velocity.c[a][n] - turning.c[a][n]) < Real(1e-4));
}

TEST_CASE("Confinement agrees with its formula and gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  Scene start;
  start.params.vorticity_confinement = 1.5;
  std::mt19937 random(5);
  for (auto& component : start.velocity.c)
    for (Real& v : component) v = static_cast<Real>(random() % 1000) / 1000;
  for (int j = 4; j <= 6; ++j) start.specific_volume[start.g.node(5, j, 5)] = Real(0.01);  // a solid
  Scene one = start;
  add_body_forces(Parallel(1), one.g, one.params, one.state, {0, 0, 0}, 0.1, one.specific_volume, one.velocity);
  for (int threads : {2, 3, 8}) {
    Scene s = start;
    add_body_forces(Parallel(threads), s.g, s.params, s.state, {0, 0, 0}, 0.1, s.specific_volume, s.velocity);
    for (std::size_t a = 0; a < 3; ++a) CHECK(s.velocity.c[a] == one.velocity.c[a]);
  }
  const Grid& g = start.g;
  const auto vorticity = [&](const Vec3i& at) {
    Mat3d gradient;  // of v_a along b, one-sided at the walls
    for (int b = 0; b < 3; ++b) {
      const auto s = static_cast<std::size_t>(b);
      Vec3i low = at, high = at;
      low[s] = std::max(0, at[s] - 1);
      high[s] = std::min(10, at[s] + 1);
      const auto value = [&](const Vec3i& q) -> Vec3d {
        return start.velocity.at(g.node(q[0], q[1], q[2])).cast<double>();
      };
      gradient.col(b) = (value(high) - value(low)) / (g.h * (high[s] - low[s]));
    }
    return Vec3d(gradient(2, 1) - gradient(1, 2), gradient(0, 2) - gradient(2, 0), gradient(1, 0) - gradient(0, 1));
  };
  for (int k = 0; k <= 10; ++k)
    for (int j = 0; j <= 10; ++j)
      for (int i = 0; i <= 10; ++i) {
        const std::size_t n = g.node(i, j, k);
        Vec3d expected = start.velocity.at(n).cast<double>();
        bool acts = i > 0 && j > 0 && k > 0 && i < 10 && j < 10 && k < 10;
        if (acts) {
          Vec3d gradient;
          for (std::size_t a = 0; a < 3; ++a) {
            Vec3i low = {i, j, k}, high = low;
            --low[a];
            ++high[a];
            gradient[static_cast<Eigen::Index>(a)] = vorticity(high).norm() - vorticity(low).norm();
            for (const Vec3i& q : {low, Vec3i{i, j, k}, high})
              acts = acts && start.specific_volume[g.node(q[0], q[1], q[2])] == 1;
          }
          if (acts) expected += 1.5 * g.h * 0.1 * gradient.normalized().cross(vorticity({i, j, k}));
        }
        REQUIRE((one.velocity.at(n).cast<double>() - expected).norm() < 1e-4);
      }
}
