// Purpose: linear extension of node fields.
#include <catch2/catch.hpp>
#include <cmath>

#include "grid/extrapolate.hpp"

using namespace efsi;
using namespace efsi::grid;

namespace {

struct Extension {
  Grid g;
  std::vector<std::uint8_t> layer;
  std::vector<Real> linear, wavy;

  // Data inside a ball of radius 4 cells; the rest of the fields holds rubbish.
  Extension() {
    g.cells = {21, 20, 19};
    layer.assign(g.node_count(), kNoLayer);
    linear.assign(g.node_count(), 1000);
    wavy = linear;
    for (int k = 0; k <= 19; ++k)
      for (int j = 0; j <= 20; ++j)
        for (int i = 0; i <= 21; ++i) {
          if ((Vec3d(i, j, k) - Vec3d(10.2, 9.7, 4.5)).norm() > 4.0) continue;
          const std::size_t n = g.node(i, j, k);
          layer[n] = 0;
          linear[n] = value(i, j, k);
          wavy[n] = static_cast<Real>(std::sin(0.7 * i) * std::cos(0.5 * j + k));
        }
  }
  static Real value(int i, int j, int k) { return static_cast<Real>(0.25 * i - 0.5 * j + 0.125 * k + 2.0); }
  void extend(int threads, int layers) {
    Real* fields[] = {linear.data(), wavy.data()};
    extend_linear(Parallel(threads), g, layers, layer, fields);
  }
};

}  // namespace

TEST_CASE("A linear field extends to itself") {
  Extension e;
  e.extend(1, 5);
  const double tolerance = sizeof(Real) == 8 ? 1e-10 : 1e-4;
  std::size_t extended = 0;
  for (int k = 0; k <= 19; ++k)
    for (int j = 0; j <= 20; ++j)
      for (int i = 0; i <= 21; ++i) {
        const std::size_t n = e.g.node(i, j, k);
        if (e.layer[n] == kNoLayer) {
          CHECK(e.linear[n] == 1000);  // untouched
          continue;
        }
        extended += e.layer[n] > 0;
        REQUIRE(static_cast<double>(e.linear[n]) ==
                Approx(static_cast<double>(Extension::value(i, j, k))).margin(tolerance));
      }
  CHECK(extended > 1000);
}

TEST_CASE("Layers count the distance from the data through the 26 neighbours") {
  Extension e;
  const std::vector<std::uint8_t> data = e.layer;
  e.extend(1, 3);
  for (int k = 0; k <= 19; ++k)
    for (int j = 0; j <= 20; ++j)
      for (int i = 0; i <= 21; ++i) {
        int distance = 100;
        for (int c = 0; c <= 19; ++c)
          for (int b = std::max(0, j - 3); b <= std::min(20, j + 3); ++b)
            for (int a = std::max(0, i - 3); a <= std::min(21, i + 3); ++a)
              if (data[e.g.node(a, b, c)] == 0)
                distance = std::min(distance, std::max({std::abs(a - i), std::abs(b - j), std::abs(c - k)}));
        const int expected = distance <= 3 ? distance : kNoLayer;
        REQUIRE(static_cast<int>(e.layer[e.g.node(i, j, k)]) == expected);
      }
}

TEST_CASE("The extension gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  Extension one;
  one.extend(1, 5);
  for (int threads : {2, 3, 8}) {
    Extension e;
    e.extend(threads, 5);
    CHECK(e.layer == one.layer);
    CHECK(e.linear == one.linear);
    CHECK(e.wavy == one.wavy);
  }
}

TEST_CASE("One node of data extends to a constant") {
  Grid g;
  g.cells = {8, 8, 8};
  std::vector<std::uint8_t> layer(g.node_count(), kNoLayer);
  std::vector<Real> field(g.node_count(), 0);
  layer[g.node(4, 4, 4)] = 0;
  field[g.node(4, 4, 4)] = 3;
  Real* fields[] = {field.data()};
  extend_linear(Parallel(1), g, 1, layer, fields);
  CHECK(static_cast<double>(field[g.node(5, 5, 5)]) == Approx(3.0));
  CHECK(static_cast<double>(field[g.node(3, 4, 4)]) == Approx(3.0));
}

TEST_CASE("Data that weigh little hardly count") {
  // A slope of 1 along x, and at its end a node that is off by 1.
  Grid g;
  g.cells = {10, 4, 4};
  const auto extended = [&](Real weight) {
    std::vector<std::uint8_t> layer(g.node_count(), kNoLayer);
    std::vector<Real> field(g.node_count(), 0), weights(g.node_count(), 0);
    for (int k = 0; k <= 4; ++k)
      for (int j = 0; j <= 4; ++j)
        for (int i = 0; i <= 6; ++i) {
          const std::size_t n = g.node(i, j, k);
          layer[n] = 0;
          field[n] = static_cast<Real>(i == 6 ? i + 1 : i);
          weights[n] = i == 6 ? weight : Real(2);
        }
    Real* fields[] = {field.data()};
    extend_linear(Parallel(1), g, 1, layer, fields, {weights, 2});
    return static_cast<double>(field[g.node(7, 2, 2)]);
  };
  CHECK(extended(2) > 8.0);
  CHECK(extended(0) == extended(Real(0.02)));  // one hundredth at least
  CHECK(extended(0) == Approx(7.25).margin(0.35));
  CHECK(extended(6) == extended(2));
}
