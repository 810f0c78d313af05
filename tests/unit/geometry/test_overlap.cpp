// Purpose: depth and volume of the overlap of two solids against closed forms.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "geometry/mesh_sdf.hpp"
#include "geometry/overlap.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

SignedDistance field(const TriangleMesh& mesh, double spacing) { return examine(mesh, spacing)->distance; }

}  // namespace

TEST_CASE("The overlap of two balls is their lens", "[law]") {
  const double spacing = 0.02, r = 0.4, R = 0.3;
  const SignedDistance first = field(shapes::sphere(r, 32), spacing);
  for (const double d : {0.45, 0.55, 0.65}) {
    const Overlap found = overlap(first, field(shapes::sphere(R, 32, {d, 0, 0}), spacing));
    const double depth = r + R - d;
    const double lens = std::numbers::pi * depth * depth *
                        (d * d + 2 * d * r - 3 * r * r + 2 * d * R + 6 * r * R - 3 * R * R) / (12 * d);
    CAPTURE(d);
    CHECK(found.depth == Approx(depth).margin(0.5 * spacing));
    CHECK(found.volume == Approx(lens).epsilon(depth > 6 * spacing ? 0.05 : 0.2));  // thin: a few nodes across
  }
}

TEST_CASE("The overlap of two boxes is a box, also one that lies within the other", "[law]") {
  const SignedDistance large = field(shapes::box({0, 0, 0}, {1, 0.8, 0.6}), 0.02);
  const Overlap corner = overlap(large, field(shapes::box({0.7, 0.5, 0.4}, {1.5, 1.5, 1.5}), 0.02));
  CHECK(corner.depth == Approx(0.2).margin(0.01));
  CHECK(corner.volume == Approx(0.3 * 0.3 * 0.2).epsilon(0.03));
  const Overlap within = overlap(large, field(shapes::box({0.2, 0.2, 0.2}, {0.5, 0.6, 0.4}), 0.03));  // other spacing
  CHECK(within.depth == Approx(0.2).margin(0.03));
  CHECK(within.volume == Approx(0.3 * 0.4 * 0.2).epsilon(0.04));
}

TEST_CASE("Solids that are apart or touch do not overlap") {
  const SignedDistance box = field(shapes::box({0, 0, 0}, {1, 1, 1}), 0.05);
  for (const double x : {1.0, 1.1, 3.0}) {
    const Overlap found = overlap(box, field(shapes::box({x, 0, 0}, {x + 1, 1, 1}), 0.05));
    CAPTURE(x);
    CHECK(found.depth == 0.0);
    CHECK(found.volume == 0.0);
  }
  const SignedDistance hollow =
      field(shapes::together(shapes::sphere(1.0, 24), shapes::inside_out(shapes::sphere(0.7, 20))), 0.05);
  CHECK(overlap(hollow, field(shapes::sphere(0.5, 16), 0.05)).depth == 0.0);  // a ball in its cavity
}

TEST_CASE("The overlap does not depend on threads and order", "[law]") {
  const SignedDistance a = field(shapes::sphere(0.4, 20), 0.03), b = field(shapes::torus(0.3, 0.1, 30, 12), 0.025);
  const Overlap first = overlap(a, b);
  for (const int threads : {2, 3, 8}) {
    const Overlap other = overlap(b, a, Parallel(threads));
    CHECK(other.depth == first.depth);
    CHECK(other.volume == first.volume);
  }
}
