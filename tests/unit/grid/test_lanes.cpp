// Purpose: interpolation for eight points at once against that of one.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "grid/interpolate.hpp"
#include "grid/lanes.hpp"
#include "reference/faded_range.hpp"

using namespace efsi;
using namespace efsi::grid;

namespace {

constexpr double kTolerance = sizeof(Real) == 8 ? 1e-13 : 2e-6;

struct Field {
  Grid g;
  std::vector<Real> values;
  explicit Field(const Vec3i& cells) {
    g.cells = cells;
    std::mt19937 random(5);
    values.resize(g.node_count());
    for (Real& v : values) v = static_cast<Real>(random() % 2000) / 1000 - 1;
  }
};

Octets displaced(std::mt19937& random, const Vec3& middle, Real spread) {
  Octets e;
  for (int a = 0; a < 3; ++a)
    for (int l = 0; l < kLanes; ++l) e.c[a][l] = middle[a] + spread * (static_cast<Real>(random() % 2001) / 1000 - 1);
  return e;
}

}  // namespace

TEST_CASE("Eight points read what each of them reads, and are limited to the same range") {
  const Field f({23, 14, 12});
  const LaneSampler lanes(f.g.nodes());
  const NodeSampler one(f.g);
  std::mt19937 random(8);
  int held = 0, in_one_cell = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const int i = static_cast<int>(random() % 16), j = static_cast<int>(random() % 15),
              k = static_cast<int>(random() % 13);
    const Vec3 middle(static_cast<Real>(random() % 60) / 10 - 3, static_cast<Real>(random() % 60) / 10 - 3,
                      static_cast<Real>(random() % 60) / 10 - 3);
    const Octets e = displaced(random, middle, Real(0.5) * static_cast<Real>(random() % 3));
    LaneSampler::Place at{};
    if (!lanes.place(i, j, k, e, at)) continue;
    ++held;
    const std::size_t n = f.g.node(i, j, k);
    const Octet value = lanes.value(f.values.data() + n, at);
    const Octet limited[2] = {lanes.limit(f.values.data() + n, at, octet(-5)),
                              lanes.limit(f.values.data() + n, at, octet(5))};
    LaneSampler::Cell cell{};
    if (lanes.place(i, j, k, e, cell)) {
      ++in_one_cell;
      const Octet same = lanes.value(f.values.data() + n, cell);
      const Octet range[2] = {lanes.limit(f.values.data() + n, cell, octet(-5)),
                              lanes.limit(f.values.data() + n, cell, octet(5))};
      for (int l = 0; l < kLanes; ++l) {
        CHECK(static_cast<double>(same[l]) == Approx(static_cast<double>(value[l])).margin(8 * kTolerance));
        for (int side = 0; side < 2; ++side)
          CHECK(static_cast<double>(range[side][l]) ==
                Approx(static_cast<double>(limited[side][l])).margin(100 * kTolerance));
      }
    }
    for (int l = 0; l < kLanes; ++l) {
      const Vec3 x(static_cast<Real>(i + l) + e.c[0][l], static_cast<Real>(j) + e.c[1][l],
                   static_cast<Real>(k) + e.c[2][l]);
      const Trilinear t = one.stencil(x);
      CHECK(static_cast<double>(value[l]) ==
            Approx(static_cast<double>(one.value(t, f.values.data()))).margin(8 * kTolerance));
      std::array<Real, 8> corners;
      for (std::size_t c = 0; c < 8; ++c) corners[c] = f.values[t.base + one.corners()[c]];
      const Vec3 part(t.w[1] + t.w[3] + t.w[5] + t.w[7], t.w[2] + t.w[3] + t.w[6] + t.w[7],
                      t.w[4] + t.w[5] + t.w[6] + t.w[7]);
      const auto [low, high] = reference::faded_range(corners, part);
      CHECK(static_cast<double>(limited[0][l]) == Approx(static_cast<double>(low)).margin(100 * kTolerance));
      CHECK(static_cast<double>(limited[1][l]) == Approx(static_cast<double>(high)).margin(100 * kTolerance));
    }
  }
  CHECK(held > 300);
  CHECK(in_one_cell > 100);
}

TEST_CASE("A cell that touches a face of the field is told from one that does not") {
  const Field f({23, 14, 12});
  const LaneSampler lanes(f.g.nodes());
  LaneSampler::Cell cell{};
  Octets e{};
  e.c[0] = octet(Real(-0.5));
  REQUIRE(lanes.place(2, 5, 5, e, cell));
  CHECK(cell.inner);
  REQUIRE(lanes.place(1, 5, 5, e, cell));
  CHECK_FALSE(cell.inner);
  CHECK_FALSE(lanes.place(0, 5, 5, e, cell));
  e.c[0] = octet(Real(0.5));
  REQUIRE(lanes.place(14, 5, 5, e, cell));
  CHECK(cell.inner);
  REQUIRE(lanes.place(15, 5, 5, e, cell));
  CHECK_FALSE(cell.inner);
  CHECK_FALSE(lanes.place(16, 5, 5, e, cell));
  e.c[1] = Octet{Real(0.1), Real(0.1), Real(-0.1), 0, 0, 0, 0, 0};  // two cells
  CHECK_FALSE(lanes.place(14, 5, 5, e, cell));
}

TEST_CASE("Points at rest read their own values to the bit") {
  const Field f({23, 14, 12});
  const LaneSampler lanes(f.g.nodes());
  for (const Vec3i& from : {Vec3i{0, 0, 0}, Vec3i{16, 14, 12}, Vec3i{7, 3, 12}}) {
    LaneSampler::Place at{};
    REQUIRE(lanes.place(from[0], from[1], from[2], Octets{}, at));
    const Real* here = f.values.data() + f.g.node(from[0], from[1], from[2]);
    const Octet value = lanes.value(here, at);
    for (int l = 0; l < kLanes; ++l) CHECK(value[l] == here[l]);
  }
}

TEST_CASE("Points that leave the field, lie too far apart or are not numbers are not held") {
  const Field f({23, 14, 12});
  const LaneSampler lanes(f.g.nodes());
  LaneSampler::Place at{};
  const auto held = [&](int i, int j, int k, const Octets& e) { return lanes.place(i, j, k, e, at); };
  Octets e{};
  CHECK(held(5, 5, 5, e));
  LaneSampler::Cell cell{};
  for (const Real far : {Real(-5.5), Real(12), Real(1e30), std::numeric_limits<Real>::quiet_NaN()}) {
    Octets out{};
    out.c[1] = octet(far);
    CHECK_FALSE(held(5, 5, 5, out));
    CHECK_FALSE(lanes.place(5, 5, 5, out, cell));
  }
  e.c[2][3] = Real(2.25);  // the others stay
  CHECK_FALSE(held(5, 5, 5, e));
  e.c[2][3] = Real(1.75);
  CHECK(held(5, 5, 5, e));
  const LaneSampler thin(Vec3i{24, 2, 15});
  CHECK_FALSE(thin.place(5, 0, 5, Octets{}, at));
}
