// Purpose: the particles that carry a solid's velocity.
#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "grid/extrapolate.hpp"
#include "solid/map/displacement.hpp"
#include "solid/momentum.hpp"
#include "solid/particles/particles.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

const material::Elastic kSoft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);
const Vec3d kCenter(0.301, 0.297, 0.303);
using Velocity = std::function<Vec3d(const Vec3d&)>;

// A ball with a velocity at the nodes that carry it and beyond, as line 13 leaves it.
TestSolid moving_ball(double h, double radius, const Velocity& velocity, int threads = 1) {
  const Parallel parallel(threads);
  TestSolid s = make_ball(cube_grid(static_cast<int>(std::lround(0.6 / h)), h), kSoft, kCenter, radius);
  compute(s, 1, threads);
  grid::VectorField v;
  const grid::Grid& g = s.global;
  v.assign(g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) v.set(g.node(i, j, k), velocity(g.node_position(i, j, k)).cast<Real>());
  solid::take_velocity(parallel, g, 0.0, v, s.state, s.work);
  solid::extend(parallel, s.rest, s.state, s.work);
  return s;
}

solid::Particles seed(const TestSolid& s, std::uint64_t number = 3, int threads = 1) {
  solid::Particles particles;
  solid::seed_particles(Parallel(threads), s.rest, s.state, s.work, number, particles);
  return particles;
}

// Largest error of the velocity at the nodes that carry the solid, or at those in whose eight cells it is whole.
double largest_error(const TestSolid& s, const Velocity& exact, bool interior) {
  const grid::Grid& g = s.state.band.grid;
  double worst = 0.0;
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    if (!s.work.carries[n]) continue;
    const auto [i, j, k] = g.node_place(n);
    const Vec3d x = g.node_position(i, j, k);
    if (interior && (x - kCenter).norm() > 0.1 - 2.0 * g.h) continue;
    worst = std::max(worst, (s.state.v.at(n).cast<double>() - exact(x)).norm());
  }
  return worst;
}

}  // namespace

TEST_CASE("A cell that is all solid holds eight particles, one in each eighth, and none lies outside the solid") {
  const double h = 0.02, radius = 0.1;
  const TestSolid s = moving_ball(h, radius, [](const Vec3d&) { return Vec3d::Zero(); });
  const solid::Particles particles = seed(s);
  const grid::Grid& g = s.state.band.grid;
  std::vector<int> count(g.cell_count(), 0);
  std::vector<unsigned> eighths(g.cell_count(), 0);
  double mass = 0.0;
  for (std::size_t p = 0; p < particles.size(); ++p) {
    CHECK((particles.x[p] - kCenter).norm() < radius + 0.05 * h);  // the distance is sampled every half cell
    Vec3i cell;
    unsigned eighth = 0;
    for (int a = 0; a < 3; ++a) {
      const double at = (particles.x[p][a] - g.origin[a]) / h;
      cell[static_cast<std::size_t>(a)] = static_cast<int>(at);
      eighth |= (at - std::floor(at) < 0.5 ? 0u : 1u) << a;
    }
    ++count[g.cell(cell[0], cell[1], cell[2])];
    eighths[g.cell(cell[0], cell[1], cell[2])] |= 1u << eighth;
    mass += static_cast<double>(particles.mass[p]);
  }
  int whole = 0;
  for (std::size_t c = 0; c < g.cell_count(); ++c) {
    CHECK(count[c] <= 8);
    if (s.work.fraction[c] < 1) continue;
    ++whole;
    CHECK(count[c] == 8);
    CHECK(eighths[c] == 255u);
  }
  CHECK(whole > 200);
  CHECK(mass == Approx(s.rest.density * s.rest.volume).epsilon(0.02));
  // Another step has other particles, the same step the same ones.
  CHECK(seed(s).x == particles.x);
  CHECK(seed(s, 4).x != particles.x);
}

TEST_CASE("Particles keep a constant velocity to rounding", "[law]") {
  const Vec3d velocity(1.0, -0.37, 0.61);
  const auto constant = [&](const Vec3d&) { return velocity; };
  TestSolid s = moving_ball(0.02, 0.1, constant);
  solid::Particles particles = seed(s);
  solid::rasterize(Parallel(1), 0.02, s.rest, particles, s.state, s.work);
  CHECK(largest_error(s, constant, false) < 1e-5);
}

TEST_CASE("Particles have the velocity of a linear field to rounding, and give it back but for where they lie",
          "[law]") {
  Mat3d a;
  a << 0.3, -1.0, 0.2, 0.8, -0.5, 0.4, -0.6, 0.1, 0.2;
  const auto linear = [&](const Vec3d& x) -> Vec3d { return Vec3d(0.1, 0.2, -0.3) + a * (x - kCenter); };
  const double h = 0.02;
  TestSolid s = moving_ball(h, 0.1, linear);
  solid::Particles particles = seed(s);
  for (std::size_t p = 0; p < particles.size(); ++p)
    CHECK((particles.v[p].cast<double>() - linear(particles.x[p])).norm() < 1e-4 * h);
  // v_i = v at the weighted mean of the particles around: one in each eighth keeps it within a tenth of a cell of the
  // node, and on the mean at it.
  solid::rasterize(Parallel(1), 0.0, s.rest, particles, s.state, s.work);
  const double worst = largest_error(s, linear, true);
  CHECK(worst < 0.15 * h * a.norm());
  CHECK(worst > 0.005 * h * a.norm());  // they do not lie on the nodes
}

TEST_CASE("What goes over particles keeps all momentum but what rasterisation takes of the spin of a ball, 5/6 (h/R)^2",
          "[law]") {
  // Sum of the particles' angular momenta about the centre, against that of the same masses at the nodes which they
  // are spread to: the tent has a variance of h^2/6 per axis, so that the nodes' inertia is larger by 2 M h^2/6, of
  // 2/5 M R^2. The velocity that the nodes get carries the particles' angular momentum, and so lacks that much.
  const Vec3d spin(0, 0, 3);
  const auto turning = [&](const Vec3d& x) -> Vec3d { return spin.cross(x - kCenter); };
  for (const double h : {0.02, 0.01}) {
    const double radius = 0.1, dt = 1e-3;
    TestSolid s = moving_ball(h, radius, turning);
    const Parallel parallel(1);
    const solid::Momenta before = solid::measure_momenta(parallel, s.state.band, s.work, s.state.band.grid, s.state.v);
    solid::Particles particles = seed(s);
    double on_particles = 0.0, inertia = 0.0;
    for (std::size_t p = 0; p < particles.size(); ++p) {
      const Vec3d arm = particles.x[p] - kCenter;
      const double m = static_cast<double>(particles.mass[p]);
      on_particles += m * arm.cross(particles.v[p].cast<double>())[2];
      inertia += m * (arm[0] * arm[0] + arm[1] * arm[1]);
    }
    CHECK(on_particles == Approx(inertia * spin[2]).epsilon(1e-4));  // the gather takes none
    solid::rasterize(parallel, dt, s.rest, particles, s.state, s.work);
    const solid::Momenta after = solid::measure_momenta(parallel, s.state.band, s.work, s.state.band.grid, s.state.v);
    const double lost = 1.0 - after.angular[2] / before.angular[2];
    const double filter = 5.0 / 6.0 * h * h / (radius * radius);
    INFO("h " << h << " lost " << lost << " filter " << filter);
    CHECK(lost > 0.8 * filter);
    CHECK(lost < 1.3 * filter);
    CHECK((after.linear - before.linear).norm() < 2e-3 * before.mass * spin[2] * radius);
  }
}

TEST_CASE("Particles that move take their velocity along") {
  // A velocity that falls off along x, carried half a cell along x.
  const double h = 0.02, dt = 0.01, speed = 0.5 * h / dt;
  const auto shear = [&](const Vec3d& x) -> Vec3d { return Vec3d(speed, 20.0 * (x[0] - kCenter[0]), 0.0); };
  const auto moved = [&](const Vec3d& x) -> Vec3d { return shear(x - Vec3d(speed * dt, 0, 0)); };
  TestSolid s = moving_ball(h, 0.1, shear);
  solid::Particles particles = seed(s);
  solid::rasterize(Parallel(1), dt, s.rest, particles, s.state, s.work);
  CHECK(largest_error(s, moved, true) < 0.3 * largest_error(s, shear, true));
}

TEST_CASE("Particles give the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const auto run = [](int threads) {
    TestSolid s = moving_ball(
        0.02, 0.1, [](const Vec3d& x) { return Vec3d(x[1], -x[0], 0.2); }, threads);
    solid::Particles particles = seed(s, 9, threads);
    solid::rasterize(Parallel(threads), 0.03, s.rest, particles, s.state, s.work);
    return std::pair(s.state.v.c, s.work.layer);
  };
  const auto one = run(1);
  for (const int threads : {2, 3, 8}) CHECK(run(threads) == one);
}
