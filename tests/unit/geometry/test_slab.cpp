// The section of a mesh in a slab: distances in the plane, the volume in the slab, what is refused.
#include <catch2/catch.hpp>

#include "base/error.hpp"
#include "geometry/slab.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

constexpr double kH = 0.04;

std::shared_ptr<const Surface> laid(const TriangleMesh& mesh, const Slab& slab) {
  return extrude_in_slab(*examine(mesh, 0.5 * kH), slab);
}

}  // namespace

TEST_CASE("A bar in a slab is its section, wherever along the axis", "[slab]") {
  for (const int axis : {0, 1, 2}) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Vec3d low, high;
    low[axis] = -0.3, low[u] = -0.2, low[v] = -0.1;
    high[axis] = 0.5, high[u] = 0.25, high[v] = 0.3;
    const auto bar = laid(shapes::box(low, high), {axis, 0.0, kH});
    for (const double along : {-1.0, 0.0, 0.5 * kH, 3.0}) {
      Vec3d x;
      x[axis] = along;
      x[u] = 0.3, x[v] = 0.1;
      CHECK(bar->distance.sample(x) == Approx(0.05).margin(1e-6));
      x[u] = 0.2;
      CHECK(bar->distance.sample(x) == Approx(-0.05).margin(1e-6));
      CHECK(bar->distance.gradient(x)[axis] == 0.0);
    }
    CHECK(bar->report.solid_volume == Approx(0.45 * 0.4 * kH).epsilon(1e-9));
    CHECK(bar->report.extent_min[axis] == 0.0);
    CHECK(bar->report.extent_max[axis] == kH);
    CHECK(bar->report.thinnest_feature == Approx(0.4).epsilon(1e-6));
    CHECK(bar->distance.volume() == Approx(bar->report.solid_volume).epsilon(0.01));
    CHECK(bar->along.front() == low[axis]);
    for (const Vec3d& x : bar->mesh.points) CHECK((x[axis] > 0.0 && x[axis] < kH));
    // The mesh of the slab encloses what the solid has there, but for the inset.
    CHECK(signed_volume(bar->mesh) == Approx(bar->report.solid_volume).epsilon(0.03));
  }
}

TEST_CASE("A ball in a slab is the disc of its middle plane; a hole stays a hole", "[slab]") {
  const double r = 0.3;
  const auto disc = laid(shapes::sphere(r, 24), {2, 0.1, 0.1 + kH});
  const double radius = std::sqrt(r * r - 0.12 * 0.12);
  CHECK(disc->report.solid_volume == Approx(std::numbers::pi * radius * radius * kH).epsilon(0.01));
  CHECK(disc->distance.sample({0.1, 0.0, 7.0}) == Approx(0.1 - radius).margin(2e-3));
  const TriangleMesh hollow = shapes::together(shapes::box({-0.4, -0.4, -1}, {0.4, 0.4, 1}),
                                               shapes::inside_out(shapes::box({-0.2, -0.2, -0.9}, {0.2, 0.2, 0.9})));
  const auto tube = laid(hollow, {2, 0.0, kH});
  CHECK(tube->distance.sample({0.0, 0.0, 0.0}) == Approx(0.2).margin(1e-6));
  CHECK(tube->distance.sample({0.3, 0.0, 0.0}) == Approx(-0.1).margin(1e-6));
  CHECK(tube->report.solid_volume == Approx((0.64 - 0.16) * kH).epsilon(1e-9));
  const auto turned = laid(shapes::inside_out(hollow), {2, 0.0, kH});
  CHECK(signed_volume(turned->mesh) == Approx(signed_volume(tube->mesh)).epsilon(1e-12));
  CHECK(turned->distance.values == tube->distance.values);
  CHECK(tube->report.thinnest_feature == Approx(0.2).epsilon(1e-6));
}

TEST_CASE("Two bars that lie in each other bound one section", "[slab]") {
  const auto cross = laid(
      shapes::together(shapes::box({-0.4, -0.1, -1}, {0.4, 0.1, 1}), shapes::box({-0.401, -0.1, -1}, {-0.1, 0.3, 1})),
      {2, 0.0, kH});
  CHECK(cross->distance.sample({-0.25, 0.0, 0.0}) < -0.09);  // no wall between them
}

TEST_CASE("A mesh that ends within the slab and an open section are refused", "[slab]") {
  CHECK_THROWS_WITH(laid(shapes::box({-0.2, -0.2, 0.01}, {0.2, 0.2, 0.3}), {2, 0.0, kH}),
                    Catch::Contains("extends from 0.01 to 0.3 in z: must reach through the slab, 0 to 0.04"));
  TriangleMesh open = shapes::box({-0.2, -0.2, -0.3}, {0.2, 0.2, 0.3});
  std::erase_if(open.triangles, [&](const Triangle& t) {  // a side wall
    return std::all_of(t.begin(), t.end(), [&](std::int32_t p) { return open.points[p].x() > 0.1; });
  });
  CHECK_THROWS_WITH(laid(open, {2, 0.0, kH}), Catch::Contains("open ends: must be closed"));
}

TEST_CASE("A field laid in a slab is the one halfway", "[slab]") {
  const SignedDistance ball = examine(shapes::sphere(0.3, 24), 0.02)->distance;
  const SignedDistance flat = flattened(ball, {2, 0.1, 0.14});
  for (const double z : {-1.0, 0.1, 0.12, 0.5}) CHECK(flat.sample({0.1, 0.2, z}) == flat.sample({0.1, 0.2, 0.0}));
  CHECK(flat.sample({0.1, 0.2, 0.0}) == Approx(ball.sample({0.1, 0.2, 0.12})).margin(1e-3));
}
