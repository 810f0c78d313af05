// Purpose: points of the surface that the map has lost travel with their neighbours in the material.
#include <catch2/catch.hpp>
#include <cmath>

#include "solid/surface/surface.hpp"
#include "solid/surface/surface_mend.hpp"
#include "unit/solid/hairpin.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kShift = -0.2;  // of the second leg's upper part towards the first, to which it is 0.24 away [m]
constexpr double kBend = 0.14, kStraight = 0.42, kLost = 0.5;  // heights [m]

const Hairpin kHairpin;
const double kMiddle = kHairpin.size * (kHairpin.low[0] + 4 + kHairpin.gap / 2);

// The second leg leans over to the first: the displacement of what is at height z of it.
Vec3d lean(double z) {
  const double t = std::clamp((z - kBend) / (kStraight - kBend), 0.0, 1.0);
  return {kShift * t * t * (3.0 - 2.0 * t), 0.0, 0.0};
}

// Where the material is now.
Vec3d place(const Vec3d& material) { return material[0] > kMiddle ? Vec3d(material + lean(material[2])) : material; }

// Below `top` the map is right on either side of the middle between the legs; above, it holds the first leg alone.
TestSolid make_leaning(double top) {
  TestSolid s = kHairpin.make();
  set_displacement(s, [&](const Vec3d& x) -> Vec3d {
    const bool second = x[0] > kMiddle + 0.5 * lean(x[2])[0] && x[2] < top;
    return second ? lean(x[2]) : Vec3d::Zero();
  });
  for (Vec3d& x : s.state.surface) x = place(x);
  return s;
}

double largest_error(const TestSolid& s) {
  double worst = 0.0;
  for (std::size_t i = 0; i < s.state.surface.size(); ++i)
    worst = std::max(worst, (s.state.surface[i] - place(s.rest.surface.points[i])).norm());
  return worst / kHairpin.size;
}

constexpr double kStretch = 1.7;  // of the bend
const Eigen::AlignedBox3d kEverywhere(Vec3d::Constant(-1.0), Vec3d::Constant(2.0));

}  // namespace

TEST_CASE("A sheet that the map has lost stays with its part of the solid", "[law]") {
  TestSolid s = make_leaning(kLost);
  {
    TestSolid alone = s;
    solid::place_surface(Parallel(1), alone.rest, alone.state);
    CHECK(solid::count_false_edges(alone.rest, alone.state, 1.0) > 0);  // the map leads to where it was at rest
    CHECK(largest_error(alone) > 4.0);
  }
  solid::correct_surface(Parallel(1), kEverywhere, s.rest, kStretch, s.state);
  CHECK(solid::count_false_edges(s.rest, s.state, kStretch) == 0);
  CHECK(largest_error(s) < 0.05);
}

TEST_CASE("Points that have left the data follow", "[law]") {
  TestSolid s = make_leaning(1.0);
  const grid::Grid& g = s.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        if (g.node_position(i, j, k)[2] > kLost) s.state.valid[g.node(i, j, k)] = solid::kNoData;
  // No velocity has carried them along.
  for (Vec3d& x : s.state.surface)
    if (x[2] > kLost) x[0] += 0.5 * g.h;
  solid::correct_surface(Parallel(1), kEverywhere, s.rest, kStretch, s.state);
  CHECK(largest_error(s) < 0.05);
}

TEST_CASE("Points that the map leads deep into a wall follow what lies beside them", "[law]") {
  const double h = kHairpin.size, floor = h * kHairpin.low[2];
  TestSolid s = kHairpin.make();
  // Between the legs the map has lost the lowest three quarters of a cell and goes on below the floor twice as slowly.
  set_displacement(s, [&](const Vec3d& x) -> Vec3d {
    const bool crushed = std::abs(x[0] - kMiddle) < 2.5 * h && x[2] < floor + 2.0 * h;
    return crushed ? Vec3d(0.0, 0.0, -0.6 * (floor + 2.0 * h - x[2])) : Vec3d::Zero();
  });
  grid::Walls open;
  open.face[4] = grid::Wall::kOpen;
  for (const bool wall : {false, true}) {
    TestSolid mended = s;
    grid::Grid box = s.global;
    box.origin[2] = floor;
    const auto reach = solid::map_reach(box, wall ? grid::Walls{} : open);
    solid::correct_surface(Parallel(1), reach, mended.rest, kStretch, mended.state);
    double deepest = 0.0;
    for (const Vec3d& x : mended.state.surface) deepest = std::max(deepest, (floor - x[2]) / h);
    CAPTURE(wall, deepest);
    CHECK((wall ? deepest < 1.5 : deepest > 2.0));
  }
}

// Beside the first corner of every triangle another one, 0.005 cells away: many of them in another cluster.
void add_twins(TestSolid& s) {
  geometry::TriangleMesh& mesh = s.rest.surface;
  const auto before = mesh.triangles;
  for (std::size_t t = 0; t < before.size(); ++t) {
    const auto [a, b, c] = before[t];
    const Vec3d from = mesh.points[static_cast<std::size_t>(a)], to = mesh.points[static_cast<std::size_t>(b)];
    const auto twin = static_cast<std::int32_t>(mesh.points.size());
    mesh.points.push_back(from + 0.005 * (to - from));
    mesh.triangles[t] = {twin, b, c};
    mesh.triangles.push_back({a, twin, c});
  }
  s.rest.clusters = solid::make_surface_clusters(mesh, s.rest.distance, kHairpin.size);
  s.state.surface = mesh.points;
}

TEST_CASE("Where clusters disagree points in one place stay together", "[law]") {
  TestSolid s = kHairpin.make();
  add_twins(s);
  std::vector<std::uint8_t> lost(s.state.surface.size(), 0);
  for (std::size_t i = 0; i < lost.size(); ++i) {
    Vec3d& x = s.state.surface[i];
    lost[i] = x[0] > kMiddle && x[2] > kBend && x[2] < kStraight;
    if (x[0] > kMiddle && x[2] >= kStraight) x += Vec3d(-0.1, 0.05, 0.1);  // the ends fit no rigid motion
  }
  const std::vector<std::uint8_t> made_up(lost.size(), 0);
  solid::repair_surface(Parallel(1), s.rest, kStretch, made_up, lost, s.state);
  CHECK(solid::count_false_edges(s.rest, s.state, kStretch) == 0);
}

TEST_CASE("Where the map holds everything the surface is where it says, to the last bit", "[law]") {
  TestSolid mended = make_leaning(1.0);
  for (Vec3d& x : mended.state.surface) x += Vec3d(0.003, -0.002, 0.004);
  TestSolid placed = mended;
  solid::correct_surface(Parallel(1), kEverywhere, mended.rest, kStretch, mended.state);
  solid::place_surface(Parallel(1), placed.rest, placed.state);
  CHECK(mended.state.surface == placed.state.surface);
}

TEST_CASE("A mended surface has the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const auto run = [](int threads) {
    TestSolid s = make_leaning(kLost);
    solid::correct_surface(Parallel(threads), kEverywhere, s.rest, kStretch, s.state);
    return s.state.surface;
  };
  const auto one = run(1);
  for (const int threads : {2, 3, 8}) CHECK(run(threads) == one);
}

TEST_CASE("Where nothing of the surface is known it stays where it is expected") {
  TestSolid s = make_leaning(kLost);
  std::fill(s.state.valid.begin(), s.state.valid.end(), solid::kNoData);
  const auto before = s.state.surface;
  solid::correct_surface(Parallel(1), kEverywhere, s.rest, kStretch, s.state);
  CHECK(s.state.surface == before);
  s.state.surface[0] += Vec3d(0.5, 0.0, 0.0);  // a torn edge changes nothing in that
  const auto torn = s.state.surface;
  solid::correct_surface(Parallel(1), kEverywhere, s.rest, kStretch, s.state);
  CHECK(s.state.surface == torn);
}
