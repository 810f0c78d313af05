// Purpose: packed node fields against their readable twin, interpolate.hpp.
#include <catch2/catch.hpp>
#include <random>

#include "grid/interpolate.hpp"
#include "grid/packed_field.hpp"

using namespace efsi;
using namespace efsi::grid;

namespace {

struct Fields {
  Grid g;
  VectorField plain;
  PackedField packed;
  explicit Fields(bool periodic) {
    g.cells = {6, 5, 7};
    g.periodic = {periodic, false, periodic};
    plain.assign(g.node_count());
    packed.reserve(g.node_count());
    std::mt19937 random(11);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (std::size_t n = 0; n < g.node_count(); ++n) {
      const Vec3 v(static_cast<Real>(unit(random)), static_cast<Real>(unit(random)), static_cast<Real>(unit(random)));
      plain.set(n, v);
      store_quad(packed.at(n), Quad{v[0], v[1], v[2], 0});
    }
  }
};

Quad quad(const Vec3& x) { return Quad{x[0], x[1], x[2], 0}; }
Vec3 vec(const Quad& q) { return {q[0], q[1], q[2]}; }

constexpr Real kPacked = sizeof(Real) == 8 ? Real(1e-13) : Real(2e-6);

}  // namespace

TEST_CASE("Packed interpolation, limits and traces agree with the plain ones, inside, outside and where periodic") {
  for (const bool periodic : {false, true}) {
    const Fields f(periodic);
    const NodeSampler plain(f.g);
    const PackedSampler packed(f.g);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> range(-3.0, 10.0);
    for (int trial = 0; trial < 2000; ++trial) {
      const Vec3 x(static_cast<Real>(range(random)), static_cast<Real>(range(random)),
                   static_cast<Real>(range(random)));
      const Vec3 v = plain.vector(f.plain, x);
      REQUIRE((vec(packed.value(f.packed, quad(x))) - v).norm() < 20 * kPacked);
      const auto place = packed.place(quad(x));
      const Trilinear t = plain.stencil(x);
      REQUIRE(place.node == t.base);
      Vec3 low = Vec3::Constant(10), high = -low;
      for (std::size_t offset : plain.corners()) {
        low = low.cwiseMin(f.plain.at(t.base + offset));
        high = high.cwiseMax(f.plain.at(t.base + offset));
      }
      REQUIRE(vec(packed.limit(f.packed, place, quad(Vec3::Constant(5)))) == high);
      REQUIRE(vec(packed.limit(f.packed, place, quad(Vec3::Constant(-5)))) == low);
      const Vec3 inside = Real(0.5) * (low + high);
      REQUIRE(vec(packed.limit(f.packed, place, quad(inside))) == inside);
      for (const Real step : {Real(0.8), Real(-1.3)}) {
        const Quad q = quad(x), w = quad(v);
        REQUIRE((vec(packed.trace_midpoint(f.packed, q, w, step)) - trace_midpoint(plain, f.plain, x, v, step)).norm() <
                100 * kPacked);
        REQUIRE((vec(packed.trace_rk3(f.packed, q, w, step)) - trace_rk3(plain, f.plain, x, v, step)).norm() <
                100 * kPacked);
      }
    }
  }
}

TEST_CASE("At the border of cells a limit is the range of them all, whichever of them rounding has chosen") {
  const Fields f(false);
  const PackedSampler sampler(f.g);
  for (const Real off : {Real(-5e-5), Real(0), Real(5e-5)})
    for (const Real bound : {Real(-5), Real(5)}) {
      const auto limited = [&](const Vec3& x) {
        return vec(sampler.limit_at_border(f.packed, quad(x), quad(Vec3::Constant(bound))));
      };
      const auto extreme = [&](const Vec3& a, const Vec3& b) -> Vec3 {
        const Vec3 u = vec(sampler.limit(f.packed, sampler.place(quad(a)), quad(Vec3::Constant(bound))));
        const Vec3 w = vec(sampler.limit(f.packed, sampler.place(quad(b)), quad(Vec3::Constant(bound))));
        return bound > 0 ? Vec3(u.cwiseMax(w)) : Vec3(u.cwiseMin(w));
      };
      const Real h = Real(0.5);
      CHECK(limited({3 + off, 2 + h, 1 + h}) == extreme({3 - h, 2 + h, 1 + h}, {3 + h, 2 + h, 1 + h}));
      CHECK(limited({1 + h, 2 + off, 4 + h}) == extreme({1 + h, 2 - h, 4 + h}, {1 + h, 2 + h, 4 + h}));
      CHECK(limited({1 + h, 2 + h, off}) == extreme({1 + h, 2 + h, h}, {1 + h, 2 + h, h}));  // a face of the box
      CHECK(limited({1 + h, 2 + h, 3 + h}) == extreme({1 + h, 2 + h, 3 + h}, {1 + h, 2 + h, 3 + h}));
    }
}

TEST_CASE("Packed interpolation gives the nodes' values at the nodes") {
  const Fields f(false);
  const PackedSampler sampler(f.g);
  for (int k = 0; k <= 7; ++k)
    for (int j = 0; j <= 5; ++j)
      for (int i = 0; i <= 6; ++i)
        REQUIRE(
            (vec(sampler.value(f.packed, quad(Vec3d(i, j, k).cast<Real>()))) - f.plain.at(f.g.node(i, j, k))).norm() <
            2 * kPacked);
  // A position that is not a number samples inside the box.
  const Real nan = std::numeric_limits<Real>::quiet_NaN();
  CHECK(sampler.place(Quad{nan, nan, nan, 0}).node == 0);
}
