// Purpose: motion of the reference map and of the embedded surface.
#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "solid/map/displacement.hpp"
#include "solid/surface/surface.hpp"
#include "unit/geometry/shapes.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kPi = 3.14159265358979323846;
const material::Elastic kSoft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);

// Points on the surface of a ball; advect carries them like the vertices of a mesh.
void add_surface(TestSolid& s, const Vec3d& center, double radius) {
  for (int i = 0; i < 60; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 60.0, r = std::sqrt(1.0 - z * z), angle = 2.39996 * i;
    s.rest.surface.points.push_back(center + radius * Vec3d(r * std::cos(angle), r * std::sin(angle), z));
  }
  s.state.surface = s.rest.surface.points;
}

// Moves the solid by one step of a velocity field given in the whole world.
void move(TestSolid& s, const std::function<Vec3d(const Vec3d&)>& velocity, double dt, solid::AdvectionScheme scheme,
          int threads = 1, const solid::RigidMotion& frame = {}, const solid::AffineFlow& flow = {}) {
  const Parallel parallel(threads);
  const grid::Grid& g = s.global;
  grid::VectorField v;
  v.assign(g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        v.set(g.node(i, j, k), Vec3(velocity(g.node_position(i, j, k)).cast<Real>()));
  solid::compute_mass(parallel, s.rest, s.state, s.work);
  solid::take_velocity(parallel, g, dt, v, s.state, s.work);
  solid::extend(parallel, s.rest, s.state, s.work);
  solid::AdvectWorkspace packed;
  solid::BodyStep step = solid::steady_step(frame, dt);
  step.flow = flow;
  solid::advect(parallel, scheme, dt, step, s.work, s.state, packed);
  solid::predict_surface(parallel, dt, step, packed, s.state);
  solid::correct_surface(parallel, solid::map_reach(g, {}), s.rest, 1.0, s.state);
  solid::follow_solid(g, s.rest, s.state);
}

// Largest error of u at the nodes that carry data.
double largest_error(TestSolid& s, const std::function<Vec3d(const Vec3d&)>& exact) {
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  double worst = 0.0;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!s.work.carries[n]) continue;
        worst = std::max(worst, (s.state.u.at(n).cast<double>() - exact(g.node_position(i, j, k))).norm());
      }
  return worst;
}

}  // namespace

TEST_CASE("Rigid translation is exact over many steps, and the band follows", "[law]") {
  const Vec3d start(0.2, 0.2, 0.2), velocity(1.0, 0.37, 0.61);
  for (const auto scheme : {solid::AdvectionScheme::kMacCormack, solid::AdvectionScheme::kPaper}) {
    TestSolid s = make_ball(cube_grid(40, 0.02), kSoft, start, 0.1);
    add_surface(s, start, 0.1);
    solid::move_band(s.state, solid::make_band(s.global, {5, 5, 5}, {15, 15, 15}));
    set_displacement(s, [](const Vec3d&) { return Vec3d::Zero(); });
    constexpr int kSteps = 10;
    for (int n = 0; n < kSteps; ++n)
      move(
          s, [&](const Vec3d&) { return velocity; }, 0.03, scheme);
    const Vec3d travelled = 0.03 * kSteps * velocity;
    CHECK(s.state.band.grid.lo[0] == 14);  // node 25 less 5 for the radius and the margin
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    double worst = 0.0;
    for (std::size_t n = 0; n < s.work.carries.size(); ++n)
      if (s.work.carries[n])
        worst = std::max({worst, (s.state.u.at(n).cast<double>() - travelled).norm(),
                          0.02 * (s.state.v.at(n).cast<double>() - velocity).norm()});
    CHECK(worst < 1e-5 * 0.3);
    for (std::size_t p = 0; p < s.state.surface.size(); ++p)
      CHECK((s.state.surface[p] - s.rest.surface.points[p] - travelled).norm() < 1e-5);
    CHECK(s.work.total_mass == Approx(4.0 / 3.0 * kPi * 1e-3 * s.rest.density).epsilon(0.012));
  }
}

TEST_CASE("A solid that is squashed evenly is carried exactly in the frame of that motion, however long the step",
          "[law]") {
  const Vec3d middle(0.25, 0.2, 0.25);
  solid::AffineFlow flow;
  flow.anchor = {0.25, 0.1, 0.25};  // of a floor
  flow.drift = {0.4, 0.0, 0.0};
  flow.gradient << 5.0, 2.0, 0.0, 0.0, -10.0, 0.0, 0.0, 0.0, 5.0;
  const double dt = 0.03;  // strains by 0.3
  const solid::AffineStep step = solid::affine_step(flow, dt);
  const auto before = [&](const Vec3d& x) -> Vec3d {
    return x - step.shift + step.back * (x - flow.anchor - step.shift);
  };
  const auto velocity = [&](const Vec3d& x) -> Vec3d { return flow.drift + flow.gradient * (x - flow.anchor); };
  double error[2];
  for (const bool rides : {false, true}) {
    TestSolid s = make_ball(cube_grid(25, 0.02), kSoft, middle, 0.1);
    add_surface(s, middle, 0.1);
    move(s, velocity, dt, solid::AdvectionScheme::kMacCormack, 1, {}, rides ? flow : solid::AffineFlow{});
    error[rides] = largest_error(s, [&](const Vec3d& x) -> Vec3d { return x - before(x); });
    if (!rides) continue;
    double worst = 0.0;
    for (std::size_t p = 0; p < s.state.surface.size(); ++p)
      worst = std::max(worst, (before(s.state.surface[p]) - s.rest.surface.points[p]).norm());
    CHECK(worst < 1e-6);
    const grid::Grid& g = s.state.band.grid;
    double off = 0.0;
    for (std::size_t n = 0; n < g.node_count(); ++n) {
      if (!s.work.carries[n]) continue;
      const Vec3i at = g.node_place(n);
      const Vec3d x = g.node_position(at[0], at[1], at[2]);
      off = std::max(off, (s.state.v.at(n).cast<double>() - velocity(before(x))).norm());
    }
    CHECK(off < 1e-5);
  }
  CHECK(error[1] < 1e-6);
  CHECK(error[0] > 1e-5);
}

TEST_CASE("What the velocity has changed by in a step moves with the solid, and so does its length", "[law]") {
  const Vec3d start(0.2, 0.2, 0.2), velocity(1.0, 0.37, 0.61);
  TestSolid s = make_ball(cube_grid(40, 0.02), kSoft, start, 0.1);
  add_surface(s, start, 0.1);
  // At rest before, then half as fast with a shear on it: linear, so that interpolation and extension are exact.
  const auto sheared = [&](const Vec3d& x) -> Vec3d { return velocity + Vec3d(0.0, 2.0 * (x[0] - start[0]), 0.0); };
  const double dt = 0.03;
  move(s, sheared, dt, solid::AdvectionScheme::kMacCormack, 1, {start, velocity, Vec3d::Zero()});
  CHECK(s.state.change_time == dt);
  REQUIRE(s.state.change.size() == s.state.band.grid.node_count());
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  const grid::Grid& g = s.state.band.grid;
  double worst = 0.0;
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    if (!s.work.carries[n]) continue;
    const Vec3i at = g.node_place(n);
    const Vec3d before = g.node_position(at[0], at[1], at[2]) - dt * velocity;  // the shear moves nothing along x
    worst = std::max(worst, (s.state.change.at(n).cast<double>() - sheared(before)).norm());
  }
  CHECK(worst < 1e-4);
  // Where the length is not wanted nothing is kept.
  TestSolid other = make_ball(cube_grid(40, 0.02), kSoft, start, 0.1);
  move(other, sheared, 0.0, solid::AdvectionScheme::kMacCormack);
  CHECK(other.state.change.size() == 0);
}

TEST_CASE("A rigid turn brings the map back and keeps volumes", "[law]") {
  const Vec3d center = Vec3d::Constant(0.3);
  // The field may stay on the grid, or turn with the solid.
  const bool turns = GENERATE(false, true);
  const solid::RigidMotion frame{center, Vec3d::Zero(), turns ? Vec3d(0.0, 0.0, 1.0) : Vec3d(Vec3d::Zero())};
  TestSolid s = make_ball(cube_grid(30, 0.02), kSoft, center, 0.1);
  add_surface(s, center, 0.1);
  constexpr int kSteps = 24;  // 1.3 cells per step at the surface
  const double dt = 2.0 * kPi / kSteps;
  const auto turning = [&](const Vec3d& x) { return Vec3d(center[1] - x[1], x[0] - center[0], 0.0); };
  for (int n = 0; n < kSteps; ++n) move(s, turning, dt, solid::AdvectionScheme::kMacCormack, 1, frame);
  compute(s, 1);
  CHECK(std::abs(s.work.min_det_f - 1.0) < 0.01);
  CHECK(std::abs(s.work.max_det_f - 1.0) < 0.01);
  double worst = 0.0;
  for (std::size_t p = 0; p < s.state.surface.size(); ++p)
    worst = std::max(worst, (s.state.surface[p] - s.rest.surface.points[p]).norm());
  CHECK(worst < 0.1 * 0.02);  // a tenth of a cell
  CHECK(s.work.total_mass == Approx(4.0 / 3.0 * kPi * 1e-3 * s.rest.density).epsilon(0.012));
}

TEST_CASE("Corrected third-order advection is far more accurate than the paper's in a turn") {
  const Vec3d center = Vec3d::Constant(0.3);
  const auto error = [&](solid::AdvectionScheme scheme) {
    TestSolid s = make_ball(cube_grid(30, 0.02), kSoft, center, 0.1);
    const auto turning = [&](const Vec3d& x) { return Vec3d(center[1] - x[1], x[0] - center[0], 0.0); };
    for (int n = 0; n < 6; ++n) move(s, turning, 2.0 * kPi / 24, scheme);
    // A quarter turn: X = R^T (x - c) + c.
    return largest_error(s, [&](const Vec3d& p) -> Vec3d {
      const Vec3d x = p - center;
      return x - Vec3d(x[1], -x[0], x[2]);
    });
  };
  const double corrected = error(solid::AdvectionScheme::kMacCormack), paper = error(solid::AdvectionScheme::kPaper);
  CHECK(corrected < 0.02 * 0.05);
  CHECK(corrected < 0.1 * paper);
}

namespace {

// A ball of `across` cells with a wave in its map, carried by half its radius in steps of a fifth of a cell: the
// largest error of u at the nodes that carry data.
double wave_error(int across) {
  const double radius = 0.1, h = 2 * radius / across, amplitude = 0.01, number = 20.0;
  const Vec3d center = Vec3d::Constant(0.2), velocity(1.0, -0.5, 0.3);
  TestSolid s = make_ball(cube_grid(2 * across, h), kSoft, center, radius);
  solid::move_band(s.state, solid::make_band(s.global, {across / 2, across / 2, across / 2},
                                             {3 * across / 2, 3 * across / 2, 3 * across / 2}));
  const auto wave = [&](const Vec3d& x) -> Vec3d {
    return amplitude * Vec3d(std::sin(number * x[0]), std::sin(number * x[1]), std::sin(number * (x[0] + x[2])));
  };
  set_displacement(s, wave);
  const double dt = 0.2 * h;
  const int steps = static_cast<int>(std::lround(0.5 * radius / dt));
  for (int n = 0; n < steps; ++n)
    move(
        s, [&](const Vec3d&) { return velocity; }, dt, solid::AdvectionScheme::kMacCormack);
  const Vec3d travelled = steps * dt * velocity;
  return largest_error(s, [&](const Vec3d& x) -> Vec3d { return wave(x - travelled) + travelled; });
}

}  // namespace

TEST_CASE("A wave in the map is carried to more than first order up to the edge of the solid", "[law][slow]") {
  for (const auto& [across, order] : {std::pair{14, 2.2}, {20, 2.5}}) {
    const double coarse = wave_error(across), fine = wave_error(2 * across);
    INFO("errors " << coarse << ", " << fine);
    CHECK(fine < coarse / order);
  }
}

TEST_CASE("The surface follows the map: x - u(x) is the rest position of every vertex", "[law]") {
  const Vec3d center = Vec3d::Constant(0.3);
  TestSolid s = make_ball(cube_grid(30, 0.02), kSoft, center, 0.1);
  add_surface(s, center, 0.1);
  Mat3d f;
  f << 1.2, 0.1, 0, 0, 0.9, 0.1, -0.1, 0, 1.0;
  const Mat3d inverse = f.inverse();
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - center - inverse * (x - center); });
  solid::place_surface(Parallel(1), s.rest, s.state);
  for (std::size_t p = 0; p < s.state.surface.size(); ++p)
    CHECK((s.state.surface[p] - center - f * (s.rest.surface.points[p] - center)).norm() < 1e-4 * 0.02 * 3);
  // Velocities at the vertices are those of the field.
  move(
      s, [&](const Vec3d& x) { return Vec3d(x[1], -x[0], 1.0); }, 1e-6, solid::AdvectionScheme::kMacCormack);
  std::vector<Vec3d> velocity;
  solid::sample_surface_velocity(Parallel(1), s.state, velocity);
  for (std::size_t p = 0; p < velocity.size(); ++p)
    CHECK((velocity[p] - Vec3d(s.state.surface[p][1], -s.state.surface[p][0], 1.0)).norm() < 1e-4);
}

TEST_CASE("The surface's volume over that at rest is det F, whichever way its faces wind", "[law]") {
  const grid::Grid g = cube_grid(20, 0.02);
  TestSolid s = make_ball(g, kSoft, Vec3d::Constant(0.2), 0.1);
  CHECK(solid::volume_ratio(s.rest, s.state) == 0.0);
  CHECK_FALSE(solid::encloses(s.rest));  // no faces
  s.rest.surface = geometry::shapes::sphere(0.1, 20);
  Mat3d f;
  f << 1.1, 0.2, 0, -0.3, 0.8, 0.1, 0.1, 0, 1.0;
  for (const bool inward : {false, true}) {
    if (inward) s.rest.surface = geometry::shapes::inside_out(s.rest.surface);
    s.state.surface.clear();
    for (const Vec3d& x : s.rest.surface.points) s.state.surface.push_back(f * x + Vec3d(0.3, 0.2, 0.1));
    CHECK(solid::volume_ratio(s.rest, s.state) == Approx(f.determinant()));
    CHECK(solid::encloses(s.rest));
    s.work.next_volume = f.determinant() + 0.01;
    solid::measure_leak(s.rest, s.work, s.state);
    CHECK(s.state.leak == Approx(0.01));
    s.work.next_volume = 0.0;  // nothing was asked
    solid::measure_leak(s.rest, s.work, s.state);
    CHECK(s.state.leak == 0.0);
  }
  s.rest.surface = geometry::shapes::together(s.rest.surface, s.rest.surface);  // counts everything twice
  CHECK_FALSE(solid::encloses(s.rest));
}

TEST_CASE("After a step the nodes know whether their map came from data or from the extension") {
  const Vec3d center = Vec3d::Constant(0.2);
  const double h = 0.02, speed = 0.5 * h / 0.01;  // half a cell along x
  for (const auto scheme : {solid::AdvectionScheme::kMacCormack, solid::AdvectionScheme::kPaper}) {
    TestSolid s = make_ball(cube_grid(20, h), kSoft, center, 0.08);
    move(
        s, [&](const Vec3d&) { return Vec3d(speed, 0, 0); }, 0.01, scheme);
    const grid::Grid& g = s.state.band.grid;
    const auto origin = [&](double cells) {  // of the node that far from the centre along x
      const Vec3d p = (center + Vec3d(cells * h, 0, 0) - g.origin) / h;
      return static_cast<int>(
          s.state.valid[g.node(static_cast<int>(std::lround(p[0])), static_cast<int>(std::lround(p[1])),
                               static_cast<int>(std::lround(p[2])))]);
    };
    const bool paper = scheme == solid::AdvectionScheme::kPaper;
    CHECK(origin(-3) == solid::kKnown);
    CHECK(origin(4) == solid::kKnown);
    CHECK(origin(5) == (paper ? solid::kKnown : solid::kEdge));
    CHECK(origin(-4) == (paper ? solid::kKnown : solid::kEdge));
    CHECK(origin(6) == (paper ? solid::kKnown : solid::kExtrapolated));
    CHECK(origin(-5) == (paper ? solid::kKnown : solid::kExtrapolated));
  }
}

TEST_CASE("Motion of a solid gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const auto run = [](int threads) {
    const Vec3d center(0.2, 0.21, 0.19);
    TestSolid s = make_ball(cube_grid(20, 0.02), kSoft, center, 0.08);
    add_surface(s, center, 0.08);
    for (int n = 0; n < 2; ++n)
      move(
          s, [](const Vec3d& x) { return Vec3d(std::sin(20 * x[1]), x[2], std::cos(15 * x[0])); }, 0.02,
          solid::AdvectionScheme::kMacCormack, threads);
    return s;
  };
  const TestSolid one = run(1);
  for (int threads : {2, 3, 8}) {
    const TestSolid s = run(threads);
    for (std::size_t a = 0; a < 3; ++a) {
      CHECK(s.state.u.c[a] == one.state.u.c[a]);
      CHECK(s.state.v.c[a] == one.state.v.c[a]);
    }
    CHECK(s.state.surface == one.state.surface);
    CHECK(s.state.valid == one.state.valid);
  }
}
