// Purpose: vertices that come out of another solid on another side than that by which they went in.
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "record/side_record.hpp"
#include "unit/sim/two_solids.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kSmall = 0.02;
const Vec3d kMiddle(0.2, 0.2, 0.2);

// A plate, so many cells thick along x.
TestSolid plate(double cells = 5.0) {
  const Vec3d half(0.5 * cells * kSmall, 0.12, 0.12), margin = Vec3d::Constant(3.0 * kSmall);
  return make_solid(
      cube_grid(20, kSmall), {},
      sample_distance(kMiddle - half - margin, kMiddle + half + margin, 0.5 * kSmall, [&](const Vec3d& x) {
        const Vec3d beyond = (x - kMiddle).cwiseAbs() - half;
        return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
      }));
}

// Vertices that have exchanged sides when one has been at these places, cells from the middle of the plate. thick:
// where the plate is three cells thick or more. It is out from half a cell below the surface on.
std::uint64_t exchanged(TwoSolids& s, const std::vector<Vec3d>& places, bool thick = true, double out_from = 2.0) {
  sim::ContactPairs pairs;
  for (const Vec3d& x : places) {
    s.place_vertex(kMiddle + kSmall * x, Vec3d::Zero());
    sim::record_sides(s.scene, s.states, pairs);
  }
  CHECK(pairs.size() <= 1);
  if (pairs.empty()) return 0;
  CHECK((pairs[0].one == 0 && pairs[0].other == 1 && pairs[0].steps == 0));
  CHECK(pairs[0].passed.has_value() == thick);
  if (thick) CHECK((pairs[0].passed->solid == 1 && pairs[0].passed->vertex == 0));
  const Vec3d out = pairs[0].exchanged_place;  // at the first place that is beyond the plate, or almost
  const auto beyond = std::find_if(places.begin(), places.end(), [&](const Vec3d& x) { return x[0] > out_from; });
  REQUIRE(beyond != places.end());
  CHECK(out == kMiddle + kSmall * *beyond);
  if (thick) CHECK(pairs[0].passed->place == out);
  return pairs[0].exchanged_vertices;
}

}  // namespace

TEST_CASE("A vertex that goes through a plate has exchanged sides, once; one that comes back has not") {
  TwoSolids s(plate());
  CHECK(exchanged(s, {{-3.2, 0, 0}, {-1.8, 0, 0}, {0, 0, 0}, {1.8, 0, 0}, {3.0, 0, 0}, {3.2, 0, 0}}) == 1);
  CHECK(s.states[1].deep.empty());
  CHECK(exchanged(s, {{-3.2, 0, 0}, {-1.8, 0, 0}, {0.3, 0, 0}, {-1.8, 0, 0}, {-2.3, 0, 0}}) == 0);
  CHECK(exchanged(s, {{-2.3, 0, 0}, {2.3, 0, 0}}) == 0);  // never deep: within the limit of what a step may move
}

TEST_CASE("What is three cells thick or more is passed, however far a step has gone; thinner parts are only counted") {
  TwoSolids s(plate());
  CHECK(exchanged(s, {{-3, 0, 0}, {-1.8, 0, 0}, {-1.1, 0, 0}, {1.1, 0, 0}, {2.6, 0, 0}}) == 1);
  TwoSolids sheet(plate(3.0));
  CHECK(exchanged(sheet, {{-1.7, 0, 0}, {-0.8, 0, 0}, {1.1, 0, 0}}, true, 1.0) == 1);
  TwoSolids thin(plate(2.0));
  CHECK(exchanged(thin, {{-1.2, 0, 0}, {-0.3, 0, 0}, {0.7, 0, 0}}, false, 0.5) == 1);
}

TEST_CASE("What is made up of a map beside a solid takes no vertex in") {
  TwoSolids s(plate());
  std::fill(s.body.state.valid.begin(), s.body.state.valid.end(), solid::kExtrapolated);
  CHECK(exchanged(s, {{-3.2, 0, 0}, {-1.8, 0, 0}, {0, 0, 0}, {1.8, 0, 0}, {3.0, 0, 0}}) == 0);
}

TEST_CASE("Half a cell deep around an edge no sides are exchanged, nor out of reach") {
  TwoSolids s(plate());
  CHECK(exchanged(s, {{-3, 5, 0}, {-1.9, 5.4, 0}, {-1.9, 5.6, 0}, {-1.9, 6.2, 0}}) == 0);
  CHECK(exchanged(s, {{-1.0, 0, 0}, {30, 0, 0}, {2.2, 0, 0}}) == 0);
  CHECK(s.states[1].deep.empty());
}

TEST_CASE("What is deep in another solid is remembered, part of the state and of its hash") {
  TwoSolids s(plate());
  const std::vector<Vec3d> first = {{-3.2, 0, 0}, {-1.8, 0, 0}}, then = {{0.5, 0, 0}, {2.6, 0, 0}};
  CHECK(exchanged(s, first) == 0);
  REQUIRE(s.states[1].deep.size() == 1);
  CHECK(s.states[1].deep[0].other == 0);
  CHECK(s.states[1].deep[0].normal[0] < -0.99f);
  TwoSolids later(plate());
  later.states[1].deep = s.states[1].deep;
  CHECK(exchanged(later, then) == 1);
  CHECK(exchanged(s, then) == 1);
}
