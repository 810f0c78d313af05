// Purpose: colliders whose points are given: they move as such whose transform is, push aside what they take up, and
// lift what lies on them.
#include <algorithm>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kCell = 0.02, kFrame = 1.0 / 24.0;

sim::SolidDesc desc_of(const geometry::TriangleMesh& mesh) {
  sim::SolidDesc d;
  d.surface = mesh;
  return d;
}

sim::Pose pose_about(const Vec3d& center, const Vec3d& turn, const Vec3d& shift) {
  return {solid::rotation(turn), center + shift - solid::rotation(turn) * center};
}

std::vector<Vec3d> placed(const sim::Pose& pose, std::vector<Vec3d> points) {
  for (Vec3d& x : points) x = pose.place(x);
  return points;
}

// Out through the face x = its upper end [m^3/s].
double flux_out(sim::Simulation& s) {
  const grid::Grid& g = s.grid();
  double sum = 0.0;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (const int b : {0, 1})
        for (const int c : {0, 1})
          sum += 0.25 * g.h * g.h * static_cast<double>(s.fluid_velocity().at(g.node(g.cells[0], j + b, k + c))[0]);
  return sum;
}

struct Moved {
  grid::VectorField fluid;
  Vec3d momentum, impulse, angular;
  double work;
};

// A ball in a fluid that moves and turns, beside one that is free. share: of the motion that its points make; the rest
// is that of its pose.
Moved move_ball(sim::Preset preset, double share) {
  sim::Params p = box_params({0.7, 0.4, 0.4}, kCell);
  p.gravity.setZero();
  p.fluid.density = 100.0;
  p.numerics = sim::numerics_of(preset);
  sim::SolidDesc free = ball_desc({0.46, 0.2, 0.2}, 0.08);
  free.contact_stiffness = 1e4;
  const auto s = make_simulation(p, {free});
  geometry::MeshReport report;
  const Vec3d center(0.24, 0.2, 0.2);
  const geometry::TriangleMesh ball = ball_mesh(center, 0.1, 24);
  const std::size_t pin = s->add_collider(desc_of(ball), report);
  const auto motion = [&](int f, double part) {
    return pose_about(center, Vec3d(0.0, 0.0, 0.1 * f) * part, Vec3d(0.02 * f, 0.0, 0.0) * part);
  };
  Moved moved;
  moved.impulse = moved.angular = Vec3d::Zero();
  moved.work = 0.0;
  for (int f = 0; f < 4; ++f) {
    if (share < 1.0)
      s->set_motion(pin, f * kFrame, (f + 1) * kFrame, motion(f, 1.0 - share), motion(f + 1, 1.0 - share));
    if (share > 0.0)
      s->set_points(pin, {f * kFrame, (f + 1) * kFrame, placed(motion(f, share), ball.points),
                          placed(motion(f + 1, share), ball.points)});
    s->advance(kFrame, [&](double, const sim::StepInfo& last) {
      moved.impulse += last.pins[pin].impulse;
      moved.angular += last.pins[pin].angular_impulse +
                       (last.pins[pin].center - center).cross(last.pins[pin].impulse);
      moved.work += last.pins[pin].work;
      return false;
    });
  }
  moved.fluid = s->fluid_velocity();
  moved.momentum = s->diagnose_solid(0).momentum;
  return moved;
}

double largest(const grid::VectorField& one, const grid::VectorField* other = nullptr) {
  double most = 0.0;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t n = 0; n < one.size(); ++n)
      most = std::max(most, std::abs(static_cast<double>(one.c[a][n]) -
                                     (other ? static_cast<double>(other->c[a][n]) : 0.0)));
  return most;
}

}  // namespace

TEST_CASE("A ball whose points move is one whose transform does", "[law]") {
  for (const sim::Preset preset : {sim::Preset::kProduction, sim::Preset::kPaper2016}) {
    const Moved pose = move_ball(preset, 0.0);
    for (const double share : {1.0, 0.5}) {
      const Moved points = move_ball(preset, share);
      const double speed = largest(pose.fluid);
      INFO("share " << share << ", fluid differs by " << largest(points.fluid, &pose.fluid) << " of " << speed
                    << " m/s, momentum " << points.momentum.transpose() << " for " << pose.momentum.transpose()
                    << ", impulse " << points.impulse.transpose() << " for " << pose.impulse.transpose()
                    << ", angular " << points.angular.transpose() << " for " << pose.angular.transpose() << ", work "
                    << points.work << " for " << pose.work);
      CHECK(pose.momentum[0] > 0.1);
      CHECK(largest(points.fluid, &pose.fluid) < 0.02 * speed);
      CHECK((points.momentum - pose.momentum).norm() < 0.01 * pose.momentum.norm());
      CHECK((points.impulse - pose.impulse).norm() < 0.01 * pose.impulse.norm());
      CHECK(points.work == Approx(pose.work).epsilon(0.01));
    }
  }
}

TEST_CASE("A ball that grows pushes its volume out of an open side", "[law]") {
  for (const sim::Preset preset : {sim::Preset::kProduction, sim::Preset::kPaper2016}) {
    sim::Params p = box_params({0.6, 0.4, 0.4}, kCell);
    p.gravity.setZero();
    p.numerics = sim::numerics_of(preset);
    p.walls.face[1] = grid::Wall::kOpen;
    const auto s = make_simulation(p);
    geometry::MeshReport report;
    const Vec3d center(0.213, 0.207, 0.191);
    const geometry::TriangleMesh ball = ball_mesh(center, 0.08, 24);
    const std::size_t pin = s->add_collider(desc_of(ball), report);
    const auto grown = [&](int f) {
      std::vector<Vec3d> points = ball.points;
      for (Vec3d& x : points) x = center + (1.0 + 0.04 * f) * (x - center);
      return points;
    };
    double out = 0.0;
    for (int f = 0; f < 8; ++f) {
      s->set_points(pin, {f * kFrame, (f + 1) * kFrame, grown(f), grown(f + 1)});
      const double before = geometry::signed_volume(grown(f), ball.triangles);
      double sum = 0.0;
      s->advance(kFrame, [&](double, const sim::StepInfo& last) {
        sum += last.dt * flux_out(*s);
        return false;
      });
      const double wanted = geometry::signed_volume(grown(f + 1), ball.triangles) - before;
      INFO("frame " << f << ": out " << sum << " m^3, grown by " << wanted);
      CHECK(sum / wanted == Approx(1.0).margin(0.02));
      out += sum;
    }
    const double all = geometry::signed_volume(grown(8), ball.triangles) -
                       geometry::signed_volume(ball.points, ball.triangles);
    INFO("out " << out << " m^3, grown by " << all);
    CHECK(out / all == Approx(1.0).margin(0.01));
  }
}
