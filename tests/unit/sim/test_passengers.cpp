// Purpose: points that ride along with a solid follow its map, inside it and around it.
#include <algorithm>

#include "base/error.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using test::ball_desc;
using test::kCell;
using test::make_simulation;
using test::still_vacuum;

namespace {

const Vec3d kCenter(0.3, 0.3, 0.3);

std::vector<Vec3d> points_around(double radius) {
  std::vector<Vec3d> points;
  for (int i = 0; i < 60; ++i) {
    const double z = -1.0 + (2 * i + 1) / 60.0, turn = 2.4 * i, ring = std::sqrt(1.0 - z * z);
    points.push_back(kCenter + radius * Vec3d(ring * std::cos(turn), ring * std::sin(turn), z));
  }
  return points;
}

// x = c + A (X - c) as the displacement field of solid 0.
void deform(sim::Simulation& s, const Mat3d& a) {
  const grid::Grid& g = s.state().solids[0].band.grid;
  const Mat3d back = a.inverse();
  std::vector<float> u(3 * g.node_count());
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d x = g.node_position(i, j, k), d = x - kCenter - back * (x - kCenter);
        for (std::size_t c = 0; c < 3; ++c)
          u[c * g.node_count() + g.node(i, j, k)] = static_cast<float>(d[static_cast<Eigen::Index>(c)]);
      }
  s.set_solid_field(0, false, u.data());
}

}  // namespace

TEST_CASE("Passengers of a solid that is turned and stretched are where its material is") {
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball_desc(kCenter)});
  const Mat3d turn = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
  const Mat3d stretch = Vec3d(1.2, 0.9, 1.0).asDiagonal();
  for (const double radius : {0.0, 0.05, 0.1, 0.1 + 4.0 * kCell}) {
    const std::vector<Vec3d> rest = points_around(radius);
    const std::size_t id = s->add_passenger(0, rest);
    for (const Mat3d& a : {turn, Mat3d(turn * stretch)}) {
      deform(*s, a);
      std::vector<Vec3d> now, velocity;
      s->locate_passenger(id, now, velocity);
      double worst = 0.0;
      for (std::size_t i = 0; i < rest.size(); ++i)
        worst = std::max(worst, (now[i] - kCenter - a * (rest[i] - kCenter)).norm());
      CAPTURE(radius);
      CHECK(worst < 2e-3 * kCell);
    }
  }
}

TEST_CASE("Passengers of a ball that spins keep their distances and its velocity", "[law]") {
  sim::SolidDesc ball = ball_desc(kCenter);
  ball.youngs_modulus = 1e6;
  ball.angular_velocity = {0, 0, 4.0};
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball});
  std::vector<Vec3d> rest = points_around(0.05), far = points_around(0.1 + 3.0 * kCell);
  rest.insert(rest.end(), far.begin(), far.end());
  const std::size_t id = s->add_passenger(0, rest);
  for (int frame = 0; frame < 6; ++frame) s->advance(1.0 / 24.0, {});
  std::vector<Vec3d> now, velocity;
  s->locate_passenger(id, now, velocity);
  double stretch = 0.0, slip = 0.0, moved = 0.0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double before = (rest[i] - rest[j]).norm();
      stretch = std::max(stretch, std::abs((now[i] - now[j]).norm() - before) / kCell);
    }
    slip = std::max(slip, (velocity[i] - Vec3d(0, 0, 4.0).cross(now[i] - kCenter)).norm() / (4.0 * 0.16));
    moved = std::max(moved, (now[i] - rest[i]).norm() / kCell);
  }
  INFO("distances change by " << stretch << " cells, velocities by " << slip);
  CHECK(moved > 5.0);
  CHECK(stretch < 0.1);
  CHECK(slip < 1.1 * 4.0 / 24.0);  // velocities are those from before the step has turned the solid
}

TEST_CASE("A passenger is no part of the state") {
  const auto with = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball_desc(kCenter)});
  const auto without = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball_desc(kCenter)});
  with->add_passenger(0, points_around(0.12));
  with->advance(0.02, {});
  without->advance(0.02, {});
  CHECK(sim::state_hash(with->state()) == sim::state_hash(without->state()));
  CHECK(with->scene_hash() == without->scene_hash());
}

TEST_CASE("Points that the band cannot hold are refused as passengers") {
  const auto s = make_simulation(still_vacuum(Vec3d::Constant(0.6)), {ball_desc(kCenter)});
  std::vector<Vec3d> points = points_around(0.05);
  points[7] = kCenter + Vec3d(0.1 + 8.0 * kCell, 0, 0);
  CHECK_THROWS_WITH(s->add_passenger(0, points), Catch::Contains("points[7] = (0.56, 0.3, 0.3) m: is 0.16") &&
                                                     Catch::Contains("must be at most 6 voxels, 0.12 m"));
  points[7][0] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(s->add_passenger(0, points), Catch::Contains("points[7]") && Catch::Contains("finite"));
  CHECK_THROWS_AS(s->add_passenger(0, {}), Error);
}
