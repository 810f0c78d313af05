// Purpose: a rod of two to four cells under its own weight against a beam.
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

// A round rod along x.
geometry::TriangleMesh rod_mesh(const Vec3d& low, double length, double radius, int parts, int sides) {
  geometry::TriangleMesh mesh;
  for (int i = 0; i <= parts; ++i)
    for (int c = 0; c < sides; ++c) {
      const double angle = 2.0 * M_PI * c / sides;
      mesh.points.push_back(low + Vec3d(length * i / parts, radius * std::cos(angle), radius * std::sin(angle)));
    }
  for (int i = 0; i < parts; ++i)
    for (int c = 0; c < sides; ++c) {
      const int a = sides * i + c, b = sides * i + (c + 1) % sides;
      mesh.triangles.push_back({a, b, a + sides});
      mesh.triangles.push_back({b, b + sides, a + sides});
    }
  const int first = (parts + 1) * sides;
  mesh.points.push_back(low);
  mesh.points.push_back(low + Vec3d(length, 0, 0));
  for (int c = 0; c < sides; ++c) {
    const int next = (c + 1) % sides, end = parts * sides;
    mesh.triangles.push_back({first, next, c});
    mesh.triangles.push_back({first + 1, end + c, end + next});
  }
  return mesh;
}

// How far the end of a clamped rod sags, over what a beam does. radius, offset: cells.
double sag(double radius, const Vec3d& offset, bool compressible, bool air) {
  constexpr double kH = 0.01, kLength = 30.0 * kH, kRoot = 6.0 * kH, kWanted = 0.04 * kLength;
  constexpr int kSides = 24;
  sim::Params p = vacuum({kLength + kRoot + 4.0 * kH, 14.0 * kH, 10.0 * kH}, kH);
  p.fluid.present = air;
  p.fluid.density = 1.0;
  const Vec3d low(2.0 * kH, (8.0 + offset[1]) * kH, (5.0 + offset[2]) * kH);
  const double r = radius * kH, whole = kRoot - 2.0 * kH + kLength;
  sim::SolidDesc rod = desc_of(rod_mesh(low, whole, r, 90, kSides));
  rod.density = 1000.0;
  rod.compressible = compressible;
  rod.poissons_ratio = 0.3;
  const double part = 2.0 * M_PI / kSides, area = 0.5 * kSides * r * r * std::sin(part);
  const double moment = area * r * r * (2.0 + std::cos(part)) / 12.0;
  const double young = rod.density * kGravity * area * std::pow(kLength, 4) / (8.0 * moment * kWanted);
  // Where the pressure keeps the volume the shear modulus counts.
  rod.youngs_modulus = compressible ? young : young / 3.0 * 2.0 * (1.0 + rod.poissons_ratio);
  rod.rayleigh_alpha = 20.0;
  const auto s = make_simulation(p, {rod});
  const double clamped = kRoot + offset[0] * kH;
  const geometry::TriangleMesh clamp = block({0.5 * clamped, 7.0 * kH, 5.0 * kH}, {0.5 * clamped, 7.0 * kH, 6.0 * kH});
  s->add_pin(0, geometry::examine(clamp, sim::kRestSpacing * kH)->distance);
  for (int frame = 0; frame < 16; ++frame) s->advance(1.0 / 24, {});
  const double free = low[0] + whole - clamped;
  return (low[1] - s->state().solids[0].surface.back()[1]) / (kWanted * std::pow(free / kLength, 4));
}

}  // namespace

TEST_CASE("A rod of 2.4 to 3.4 cells sags as a beam, wherever it lies between nodes, in vacuum and in air",
          "[law][nightly]") {
  const double radius = GENERATE(1.2, 1.7);
  const bool compressible = GENERATE(false, true), air = GENERATE(false, true);
  for (int n = 0; n < 3; ++n) {
    const double found = sag(radius, {0.31 * n, 0.25 * n, 0.13 + 0.21 * n}, compressible, air);
    INFO((air ? "air" : "vacuum") << (compressible ? ", compressible" : "") << ", radius " << radius << " h, place "
                                  << n << ": " << found << " of a beam's sag");
    CHECK(found == Approx(1.0).margin(0.15));  // in air 1.04 to 1.2 without slivers
  }
}
