// Purpose: the fluid behind the surfaces along which it slips.
#include <catch2/catch.hpp>

#include "fluid/advect.hpp"
#include "transport/fluid_behind.hpp"
#include "unit/fluid/fields.hpp"

using namespace efsi;

namespace {

constexpr int kSurface = 5;  // a solid fills the box up to these nodes of y

// Fluid in the upper part of a box, which slips along a solid in the lower one.
struct Layers {
  explicit Layers(const Vec3i& cells) : g(fluid::box(cells)), specific_volume(g.node_count(), Real(0.5)) {
    std::vector<system::SlipNode> nodes;
    for (int k = 0; k <= cells[2]; ++k)
      for (int j = kSurface; j <= cells[1]; ++j)
        for (int i = 0; i <= cells[0]; ++i) {
          specific_volume[g.node(i, j, k)] = 1;
          const bool inside = i > 0 && i < cells[0] && (cells[2] == 1 || (k > 0 && k < cells[2]));
          if (j == kSurface && inside) nodes.push_back({g.node(i, j, k), i, j, k, 0, 0, Vec3(0, 1, 0), 1, 1});
        }
    slip = system::SlipNodes(Parallel(), g, std::move(nodes), cells[2] == 1 ? 2 : -1);
  }
  sim::FluidBehind behind(int threads = 1) const { return {Parallel(threads), g, slip, specific_volume, Real(1)}; }
  // `of_fluid` where there is fluid, `of_solid` elsewhere.
  grid::VectorField two(const Vec3& of_fluid, const Vec3& of_solid) const {
    grid::VectorField v;
    v.assign(g.node_count());
    for (std::size_t n = 0; n < g.node_count(); ++n) v.set(n, specific_volume[n] == 1 ? of_fluid : of_solid);
    return v;
  }

  const grid::Grid g;
  std::vector<Real> specific_volume;
  system::SlipNodes slip;
};

}  // namespace

TEST_CASE("Behind a surface the fluid goes on as beside it") {
  const Vec3i cells = GENERATE(Vec3i{8, 12, 7}, Vec3i{8, 12, 1});
  const Layers layers(cells);
  const grid::Grid& g = layers.g;
  const sim::FluidBehind behind = layers.behind();
  const int across = cells[2] == 1 ? 2 : cells[2] - 1;
  REQUIRE(behind.nodes().size() == static_cast<std::size_t>((cells[0] - 1) * across));
  for (const std::size_t n : behind.nodes()) {
    const Vec3i place = g.node_place(n);
    CHECK(place[1] == kSurface - 1);
    CHECK((place[0] > 0 && place[0] < cells[0]));
  }
  const Vec3 fluid(1, 0.5, 0), solid(0, 0.5, 0);
  const grid::VectorField before = layers.two(fluid, solid);
  grid::VectorField field = before;
  const std::vector<Vec3> kept = behind.values(Parallel(), field);
  behind.extend(Parallel(), field);
  for (const std::size_t n : behind.nodes()) CHECK((field.at(n) - fluid).norm() < Real(1e-6));
  behind.set(Parallel(), kept, field);
  for (std::size_t a = 0; a < 3; ++a) CHECK(field.c[a] == before.c[a]);  // no other node has changed
}

TEST_CASE("Nothing slips, nothing lies behind") {
  Layers layers({8, 12, 7});
  layers.slip = {};
  CHECK(layers.behind().nodes().empty());
}

TEST_CASE("Fluid that slips along a surface that advances is not dragged along", "[law]") {
  const Layers layers({12, 12, 12});
  const grid::Grid& g = layers.g;
  const Vec3 fluid(1, 0.5, 0), solid(0, 0.5, 0);
  const std::size_t node = g.node(6, kSurface, 6);
  for (const bool extends : {false, true}) {
    grid::VectorField flow = layers.two(fluid, solid);
    if (extends) layers.behind().extend(Parallel(), flow);
    fluid::FluidState state;
    fluid::AdvectWorkspace work;
    fluid::advect_velocity(Parallel(1), g, true, 0.4 * g.h, flow, flow, layers.specific_volume, Real(1), state, work);
    const double along = static_cast<double>(state.velocity.c[0][node]);  // the surface has gone 0.2 cells
    INFO(extends << ": " << along);
    if (extends)
      CHECK(along == Approx(1.0).epsilon(1e-5));
    else
      CHECK(along < 0.95);
  }
}

TEST_CASE("What is behind surfaces has the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const Layers layers({9, 12, 11});
  grid::VectorField first = layers.two({1, 0.3, 0.1}, {0, 0.3, 0});
  for (std::size_t n = 0; n < first.size(); ++n) first.c[0][n] += static_cast<Real>(n % 17) / 17;
  const grid::VectorField start = first;
  layers.behind(1).extend(Parallel(1), first);
  for (const int threads : {2, 3, 8}) {
    grid::VectorField field = start;
    layers.behind(threads).extend(Parallel(threads), field);
    CHECK(layers.behind(threads).nodes() == layers.behind(1).nodes());
    for (std::size_t a = 0; a < 3; ++a) CHECK(field.c[a] == first.c[a]);
  }
}
