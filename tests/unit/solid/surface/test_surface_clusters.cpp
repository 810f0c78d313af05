// Purpose: which points of a surface count as neighbours in the material.
#include <algorithm>
#include <catch2/catch.hpp>

#include "geometry/triangle_mesh.hpp"
#include "unit/solid/hairpin.hpp"

using namespace efsi;
using namespace efsi::test;

TEST_CASE("Clusters hold every point once and are linked both ways") {
  const Hairpin hairpin;
  const auto mesh = hairpin.surface();
  // Two legs of 4 x 4 x 27 cubes and the 12 x 4 x 4 between them.
  CHECK(geometry::signed_volume(mesh) == Approx((2 * 4 * 4 * 27 + 12 * 4 * 4) * 8e-6));
  const auto s = hairpin.make();
  const solid::SurfaceClusters& c = s.rest.clusters;
  std::vector<std::int32_t> sorted = c.points;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) CHECK(sorted[i] == static_cast<std::int32_t>(i));
  CHECK(sorted.size() == mesh.points.size());
  const auto linked = [&](std::size_t a, std::size_t b) {
    return std::find(c.link.begin() + c.first_link[a], c.link.begin() + c.first_link[a + 1],
                     static_cast<std::int32_t>(b)) != c.link.begin() + c.first_link[a + 1];
  };
  for (std::size_t a = 0; a < c.size(); ++a) {
    CHECK_FALSE(linked(a, a));
    for (std::int32_t l = c.first_link[a]; l < c.first_link[a + 1]; ++l)
      CHECK(linked(static_cast<std::size_t>(c.link[static_cast<std::size_t>(l)]), a));
  }
}

TEST_CASE("The sides of a thin part are neighbours, parts with a gap between them are not, however near") {
  Hairpin hairpin;
  hairpin.gap = 1;
  auto s = hairpin.make();
  // Boxes of five cubes: a leg is thinner, the gap much thinner.
  const auto c = solid::make_surface_clusters(s.rest.surface, s.rest.distance, 5 * hairpin.size);
  const double end_of_first = hairpin.size * (hairpin.low[0] + 4), top = hairpin.size * (hairpin.low[2] + 6);
  std::size_t within = 0;
  for (std::size_t a = 0; a < c.size(); ++a) {
    if (c.center[a][2] < top) continue;
    const bool first = c.center[a][0] < end_of_first + 0.5 * hairpin.size;
    for (std::int32_t m = c.first[a]; m < c.first[a + 1]; ++m) {
      const Vec3d& x = s.rest.surface.points[static_cast<std::size_t>(c.points[static_cast<std::size_t>(m)])];
      CHECK((x[0] < end_of_first + 0.5 * hairpin.size) == first);
    }
    for (std::int32_t l = c.first_link[a]; l < c.first_link[a + 1]; ++l) {
      const Vec3d& other = c.center[static_cast<std::size_t>(c.link[static_cast<std::size_t>(l)])];
      if (other[2] < top) continue;
      CHECK((other[0] < end_of_first + 0.5 * hairpin.size) == first);
      ++within;
    }
  }
  CHECK(within > 0);
}
