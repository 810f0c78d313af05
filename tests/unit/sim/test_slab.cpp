// Two-dimensional scenes: a box one cell thick between slip walls.
#include <Eigen/Geometry>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kH = 0.02;

sim::Params slab_params(int axis, double edge = 0.5) {
  Vec3d size = Vec3d::Constant(edge);
  size[axis] = kH;
  return still(size, kH);
}

sim::SolidDesc disc(int axis, const Vec3d& center, double radius, double length, double along_x = 1.0) {
  sim::SolidDesc d = ball_desc(center);
  d.surface = cylinder_mesh(axis, center, radius, length, along_x);
  return d;
}

// Whether both layers of nodes hold the same bits, and nothing along the axis.
bool is_flat(const grid::Grid& g, int axis, const grid::VectorField& field) {
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    if (field.c[static_cast<std::size_t>(axis)][n] != 0) return false;
    if (g.node_place(n)[static_cast<std::size_t>(axis)] > 0) continue;
    if (field.at(n) != field.at(n + g.node_stride(axis))) return false;
  }
  return true;
}

Vec3d center_in(int axis) {
  Vec3d c = Vec3d::Constant(0.25);
  c[axis] = 0.5 * kH;
  return c;
}

}  // namespace

TEST_CASE("Nothing in a slab moves or changes across it, to the last bit", "[slab][law]") {
  const int axis = GENERATE(0, 1, 2);
  const bool fluid = GENERATE(false, true);
  sim::Params p = slab_params(axis);
  p.fluid.present = fluid;
  p.fluid.density = 300.0;
  if (axis > 0) p.fluid.vorticity_confinement = 0.2;
  const int u = (axis + 1) % 3;
  p.gravity[u] = -9.8;
  p.gravity[axis] = -3.0;  // the faces bear it
  Vec3d left = center_in(axis), right = left;
  left[u] -= 0.1;
  right[u] += 0.1;
  sim::SolidDesc a = disc(axis, left, 0.08, 3 * kH, 1.2), b = disc(axis, right, 0.08, kH);
  a.velocity[u] = 0.5;
  b.angular_velocity[axis] = 8.0;
  const auto s = make_simulation(p, {a, b});
  for (int frame = 0; frame < 8; ++frame) s->advance(1.0 / 24, {});
  for (std::size_t l = 0; l < 2; ++l) {
    const solid::SolidState& state = s->state().solids[l];
    CHECK(is_flat(state.band.grid, axis, state.u));
    CHECK(is_flat(state.band.grid, axis, state.v));
    const std::vector<Vec3d> now = s->surface_points(l);
    const auto& given = (l == 0 ? a : b).surface.points;
    bool stays = true;
    for (std::size_t v = 0; v < now.size(); ++v) stays = stays && now[v][axis] == given[v][axis];
    CHECK(stays);
    const double fell = (s->diagnose_solid(l).center - (l == 0 ? left : right))[u];
    CHECK(std::abs(fell) > 0.5 * kH);  // something happens
  }
  if (fluid) CHECK(is_flat(s->grid(), axis, s->state().fluid.velocity));
  CHECK(all_finite(s->state()));
}

TEST_CASE("A disc may start stretched in a slab, and swings back", "[slab]") {
  const int axis = GENERATE(0, 1, 2);
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  sim::SolidDesc d = disc(axis, center_in(axis), 0.1, 2 * kH);
  d.stretch[u] = 1.25;
  d.stretch[v] = 0.8;
  sim::Params p = slab_params(axis);
  p.fluid.present = false;
  const auto s = make_simulation(p, {d});
  const auto width = [&] {
    const sim::SolidDiagnostics now = s->diagnose_solid(0);
    return (now.extent_max - now.extent_min)[u] / 0.2;
  };
  CHECK(width() == Approx(1.25).epsilon(0.01));
  CHECK(s->diagnose_solid(0).volume_mesh == Approx(M_PI * 0.01 * kH).epsilon(0.01));
  double least = width();
  for (int frame = 0; frame < 4; ++frame) {
    s->advance(1.0 / 24, {});
    least = std::min(least, width());
  }
  CHECK(least < 1.05);
  CHECK(is_flat(s->state().solids[0].band.grid, axis, s->state().solids[0].u));
}

// Eight cells between walls that hold the solid as a slab's faces do are the same plane strain; with the same share of
// the stiffness on the new velocity nothing else differs but the frame of the transport and rounding.
TEST_CASE("A disc swings in a slab as between walls eight cells apart", "[slab][law]") {
  const auto swing = [](int cells) {
    sim::Params p = slab_params(2);
    p.domain_size[2] = cells * kH;
    p.fluid.present = false;
    p.numerics.unilateral_walls = p.numerics.damping_by_pace = p.numerics.resolve_impacts = false;
    Vec3d c = center_in(2);
    c[2] = 0.5 * cells * kH;
    sim::SolidDesc d = disc(2, c, 0.12, cells * kH);
    const auto s = make_simulation(p, {d});
    const grid::Grid& g = s->state().solids[0].band.grid;
    std::vector<float> v(3 * g.node_count(), 0.0f);
    for (std::size_t n = 0; n < g.node_count(); ++n) {
      const auto [i, j, k] = g.node_place(n);
      const Vec3d x = g.node_position(i, j, k) - c;
      v[n] = static_cast<float>(6.0 * x[0]);
      v[g.node_count() + n] = static_cast<float>(-6.0 * x[1]);
    }
    s->set_solid_field(0, true, v.data());
    std::vector<double> stretch;
    for (int frame = 0; frame < 24; ++frame) {
      s->advance(1.0 / 96, {});
      const sim::SolidDiagnostics now = s->diagnose_solid(0);
      stretch.push_back((now.extent_max - now.extent_min)[0]);
    }
    return stretch;
  };
  const std::vector<double> thin = swing(1), thick = swing(8);
  double largest = 0.0, apart = 0.0;
  for (std::size_t i = 0; i < thin.size(); ++i) {
    largest = std::max(largest, std::abs(thick[i] - 0.24));
    apart = std::max(apart, std::abs(thin[i] - thick[i]));
  }
  INFO("swing " << largest << " m, apart " << apart << " m");
  CHECK(largest > 0.01);
  CHECK(apart < 0.04 * largest);
}

TEST_CASE("A disc may start stretched in a slab", "[slab]") {
  const int axis = GENERATE(0, 1, 2);
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  sim::SolidDesc d = disc(axis, center_in(axis), 0.1, 3 * kH);
  d.stretch[u] = 1.4;
  d.stretch[v] = 0.8;
  const auto s = make_simulation(slab_params(axis), {d});
  const Vec3d c = center_in(axis);
  double apart = 0.0;
  const std::vector<Vec3d> start = s->surface_points(0);
  for (std::size_t i = 0; i < start.size(); ++i)
    apart = std::max(apart, (start[i] - c - d.stretch.cwiseProduct(d.surface.points[i] - c)).norm());
  CHECK(apart < 1e-6);
  CHECK(s->diagnose_solid(0).elastic_energy > 0.0);
  for (int frame = 0; frame < 3; ++frame) {
    const sim::StepInfo info = s->advance(1.0 / 96, {});
    CHECK(info.unconverged == 0);
    CHECK(info.pressure_iterations < 20 * info.steps);  // along whichever axis the slab is thin
  }
  CHECK(is_flat(s->state().solids[0].band.grid, axis, s->state().solids[0].u));
  const sim::SolidDiagnostics now = s->diagnose_solid(0);
  CHECK((now.extent_max - now.extent_min)[u] < 0.27);  // 0.28 at the start: it goes back
}

TEST_CASE("A collider moves within a slab only", "[slab]") {
  const auto s = make_simulation(slab_params(2), {disc(2, center_in(2) + Vec3d(0.1, 0, 0), 0.08, 2 * kH)});
  geometry::MeshReport report;
  const std::size_t pin = s->add_collider(disc(2, center_in(2) - Vec3d(0.12, 0, 0), 0.06, 2 * kH), report);
  const Eigen::AngleAxisd about_z(0.5, Vec3d::UnitZ()), about_x(0.5, Vec3d::UnitX());
  const Vec3d center = s->pins()[pin].motion.center;
  const auto pose = [&](const Eigen::AngleAxisd& turn) {
    sim::Pose p;
    p.turn = turn.toRotationMatrix();
    p.shift = center - p.turn * center + Vec3d(0.1, 0, 0.3);
    return p;
  };
  CHECK_THROWS_WITH(s->set_motion(pin, 0, 0.2, {}, pose(about_x)), Catch::Contains("turns out of the slab"));
  s->set_motion(pin, 0, 0.2, {}, pose(about_z));
  for (int frame = 0; frame < 5; ++frame) s->advance(0.04, {});
  CHECK(s->diagnose_solid(1).center[0] == Approx(0.23).margin(0.002));
  CHECK(s->diagnose_solid(0).center[0] > 0.352);  // pushed
  for (const solid::SolidState& state : s->state().solids) {
    CHECK(is_flat(state.band.grid, 2, state.u));
    CHECK(is_flat(state.band.grid, 2, state.v));
  }
  CHECK(is_flat(s->grid(), 2, s->state().fluid.velocity));
}

TEST_CASE("Memory of a slab is that of two layers of nodes", "[slab]") {
  sim::Params p = slab_params(2, 1.28);
  const auto thin = make_simulation(p);
  p.domain_size[2] = 8 * kH;
  const auto thick = make_simulation(p);
  thin->advance(0.01, {});
  thick->advance(0.01, {});
  const double ratio = static_cast<double>(thin->memory_bytes()) / static_cast<double>(thick->memory_bytes());
  CHECK(ratio < 3.0 / 9.0);  // cells with a layer of ghosts on either side are three layers of ten, nodes two of nine
}

TEST_CASE("A slab refuses what would leave it", "[slab]") {
  const sim::Params p = slab_params(2);
  sim::SolidDesc d = disc(2, center_in(2), 0.1, 3 * kH);
  d.velocity[2] = 1.0;
  CHECK_THROWS_WITH(make_simulation(p, {d}),
                    "EfsiSolidDef.velocity.z = 1: must be 0 in a slab, a domain one cell thick "
                    "along z");
  d.velocity[2] = 0.0;
  d.angular_velocity[0] = 1.0;
  CHECK_THROWS_WITH(make_simulation(p, {d}), Catch::Contains("EfsiSolidDef.angular_velocity.x = 1: must be 0"));
  d = disc(2, center_in(2) + Vec3d(0, 0, 1.3 * kH), 0.1, 3 * kH);
  CHECK_THROWS_WITH(make_simulation(p, {d}), Catch::Contains("must reach through the slab"));
  sim::Params thin_x = slab_params(0);
  thin_x.fluid.vorticity_confinement = 0.5;
  CHECK_THROWS_WITH(make_simulation(thin_x), Catch::Contains("must be 0 in a slab along x"));
}
