// Purpose: jets and puffs in whole steps: their volume, their work, solids in their way.
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/jets.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using fluid::Emitter;

namespace {

Emitter jet(Emitter::Shape shape, const Vec3d& middle, const Vec3d& size, const Vec3d& velocity) {
  Emitter e;
  e.shape = shape;
  Eigen::Matrix4d to_world = Eigen::Matrix4d::Identity();
  to_world.topLeftCorner<3, 3>() = size.asDiagonal();
  to_world.topRightCorner<3, 1>() = middle;
  e.from_world = to_world.inverse();
  e.mode = Emitter::Mode::kContinuous;
  e.end_time = 1e6;
  e.has_velocity = true;
  e.velocity = velocity;
  return e;
}

// A box of 0.6 x 0.4 x 0.4 m without gravity, open at its high x.
sim::Params channel(double h = 0.02) {
  sim::Params p = box_params({0.6, 0.4, 0.4}, h);
  p.gravity.setZero();
  p.walls.face[1] = grid::Wall::kOpen;
  return p;
}

// Flux through a plane of nodes across x, in the velocity that the last step has carried the fluid with [m^3/s].
double flux_across(const sim::Simulation& s, int i) {
  const grid::Grid& g = s.grid();
  double sum = 0.0;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j) {
      const double part = (j % g.cells[1] ? 1.0 : 0.5) * (k % g.cells[2] ? 1.0 : 0.5);
      sum += part * g.h * g.h * static_cast<double>(s.workspace().velocity.field.c[0][g.node(i, j, k)]);
    }
  return sum;
}

}  // namespace

TEST_CASE("A jet's flux leaves through the open side", "[law]") {
  const auto measure = [](const Emitter& e, double h, sim::Preset preset, const geometry::Surface* volume = nullptr) {
    sim::Params p = channel(h);
    p.numerics = sim::numerics_of(preset);
    auto s = make_simulation(p);
    s->add_emitter(e, volume);
    double out = 0.0, told = 0.0;
    constexpr int kFrames = 12;
    for (int frame = 0; frame < kFrames; ++frame) {
      const sim::StepInfo info = s->advance(1.0 / 24.0, {});
      out += flux_across(*s, s->grid().cells[0] - 1) / kFrames;
      told += info.jets[0] / kFrames;
    }
    CHECK(all_finite(s->state()));
    return std::pair{out, told};
  };
  const Vec3d v(2, 0, 0);
  for (const double h : {0.04, 0.02}) {
    const auto box = measure(jet(Emitter::Shape::kBox, {0.15, 0.21, 0.2}, {0.1, 0.13, 0.11}, v), h,
                             sim::Preset::kProduction);
    INFO("voxel " << h << ", box: " << box.first << " of " << 2 * 0.13 * 0.11 << " m^3/s");
    CHECK(box.first == Approx(2 * 0.13 * 0.11).epsilon(0.01));
    CHECK(box.second == Approx(2 * 0.13 * 0.11).epsilon(1e-5));
    const auto ball = measure(jet(Emitter::Shape::kSphere, {0.15, 0.2, 0.2}, Vec3d::Constant(0.14), {1.0, 0.5, 0.2}), h,
                              sim::Preset::kProduction);
    const double wanted = M_PI * 0.0049 * Vec3d(1.0, 0.5, 0.2).norm();
    INFO("voxel " << h << ", ball: " << ball.first << " of " << wanted << " m^3/s");
    CHECK(ball.first == Approx(wanted).epsilon(0.01));
  }
  const auto surface = geometry::examine(ball_mesh({0.15, 0.2, 0.2}, 0.07), 0.01);
  const auto mesh = measure(jet(Emitter::Shape::kBox, {0, 0, 0}, {1, 1, 1}, v), 0.02, sim::Preset::kProduction,
                            surface.get());
  INFO("mesh: " << mesh.first << " of " << 2 * M_PI * 0.0049);
  CHECK(mesh.first == Approx(2 * M_PI * 0.0049).epsilon(0.012));
  const auto paper =
      measure(jet(Emitter::Shape::kBox, {0.15, 0.21, 0.2}, {0.1, 0.13, 0.11}, v), 0.04, sim::Preset::kPaper2016);
  INFO("paper2016: " << paper.first << " of " << 2 * 0.13 * 0.11 << " m^3/s");
  CHECK(paper.first == Approx(2 * 0.13 * 0.11).epsilon(0.05));
}
