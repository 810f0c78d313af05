// Purpose: a slender cantilever under its own weight against Euler's elastica.
#include <array>

#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kBeamHigh = 0.1, kBeamLong = 20.0 * kBeamHigh, kBeamRoot = 0.2, kBeamDensity = 1000.0;

// A bar along x with vertices all along it, so that its mesh bends as it does.
geometry::TriangleMesh bar_mesh(const Vec3d& low, const Vec3d& high, int parts) {
  geometry::TriangleMesh mesh;
  for (int i = 0; i <= parts; ++i)
    for (int c = 0; c < 4; ++c)
      mesh.points.push_back(
          {low[0] + (high[0] - low[0]) * i / parts, c & 1 ? high[1] : low[1], c & 2 ? high[2] : low[2]});
  constexpr int around[4] = {0, 1, 3, 2};
  for (int i = 0; i < parts; ++i)
    for (int c = 0; c < 4; ++c) {
      const int a = 4 * i + around[c], b = 4 * i + around[(c + 1) % 4];
      mesh.triangles.push_back({a, a + 4, b});
      mesh.triangles.push_back({b, a + 4, b + 4});
    }
  const int end = 4 * parts;
  mesh.triangles.insert(mesh.triangles.end(),
                        {{0, 1, 2}, {1, 3, 2}, {end, end + 2, end + 1}, {end + 1, end + 2, end + 3}});
  return mesh;
}

struct Tip {
  double sag, drawn_in, angle;  // over the length; rad
};

// theta'' = -beta (1 - s) cos theta, theta(0) = 0, theta'(1) = 0: shooting for theta'(0).
Tip elastica(double beta) {
  constexpr int kParts = 2000;
  const auto shoot = [&](double first, double& last) {
    std::array<double, 4> y = {0.0, first, 0.0, 0.0};  // theta, theta', sag, way along x
    const auto rate = [&](double s, const std::array<double, 4>& at) {
      return std::array<double, 4>{at[1], -beta * (1.0 - s) * std::cos(at[0]), std::sin(at[0]), std::cos(at[0])};
    };
    const double ds = 1.0 / kParts;
    for (int i = 0; i < kParts; ++i) {
      const auto on = [&](const std::array<double, 4>& k, double by) {
        std::array<double, 4> z = y;
        for (std::size_t c = 0; c < 4; ++c) z[c] += by * k[c];
        return z;
      };
      const double s = i * ds;
      const auto a = rate(s, y), b = rate(s + 0.5 * ds, on(a, 0.5 * ds)), c = rate(s + 0.5 * ds, on(b, 0.5 * ds)),
                 d = rate(s + ds, on(c, ds));
      for (std::size_t k = 0; k < 4; ++k) y[k] += ds / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]);
    }
    last = y[1];
    return Tip{y[2], 1.0 - y[3], y[0]};
  };
  double low = 0.0, high = beta, last = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    shoot(middle, last);
    (last > 0.0 ? high : low) = middle;
  }
  return shoot(low, last);
}

void bend(double beta, bool compressible, int across, double longest_step, double bar_of_law) {
  const double h = kBeamHigh / across, nu = compressible ? 0.3 : 0.5;
  const double plane =
      12.0 * kBeamDensity * kGravity * std::pow(kBeamLong, 3) / (beta * kBeamHigh * kBeamHigh);  // E / (1 - nu^2)
  sim::Params p = vacuum({kBeamRoot + kBeamLong + 0.1, 0.9, h}, h);
  p.max_time_step = longest_step;
  sim::SolidDesc bar = desc_of(bar_mesh({0.05, 0.7, 0.0}, {kBeamRoot + kBeamLong, 0.7 + kBeamHigh, h}, 80));
  bar.density = kBeamDensity;
  bar.compressible = compressible;
  bar.poissons_ratio = 0.3;
  // Where the pressure keeps the volume the shear modulus counts.
  bar.youngs_modulus = plane * (1.0 - nu * nu) / (1.0 + nu) * (1.0 + bar.poissons_ratio);
  bar.rayleigh_alpha = 10.0;
  const auto s = make_simulation(p, {bar});
  const geometry::TriangleMesh clamp = block({0.5 * kBeamRoot, 0.75, 0.5 * h}, {0.5 * kBeamRoot, 0.1, 2.0 * h});
  s->add_pin(0, geometry::examine(clamp, sim::kRestSpacing * h)->distance);
  const std::size_t end = bar.surface.points.size() - 4;
  const auto tip = [&] {
    const auto& now = s->state().solids[0].surface;
    const Vec3d low = 0.5 * (now[end] + now[end + 2]), high = 0.5 * (now[end + 1] + now[end + 3]);
    const Vec3d middle = 0.5 * (low + high), up = high - low;
    return Tip{(0.75 - middle[1]) / kBeamLong, (kBeamRoot + kBeamLong - middle[0]) / kBeamLong,
               std::atan2(up[0], up[1])};
  };
  double before = 0.0;
  std::uint64_t unconverged = 0;
  for (int frame = 0; frame < 36; ++frame) {
    before = tip().sag;
    unconverged += s->advance(1.0 / 24, {}).unconverged;
  }
  const Tip found = tip(), wanted = elastica(beta);
  INFO("beta " << beta << ", " << across << " cells across, " << (compressible ? "compressible" : "incompressible")
               << ": sag " << found.sag / wanted.sag << ", drawn in " << found.drawn_in / wanted.drawn_in << ", angle "
               << found.angle / wanted.angle << " of the elastica's");
  CHECK(unconverged == 0);
  CHECK(found.sag == Approx(before).epsilon(1e-3));  // it lies still
  CHECK(found.sag == Approx(wanted.sag).epsilon(bar_of_law));
  CHECK(found.angle == Approx(wanted.angle).epsilon(bar_of_law));
}

}  // namespace

TEST_CASE("The elastica of the tests has the tabulated ends") {
  const Tip tip = elastica(2.0);
  CHECK(tip.sag == Approx(0.238507).margin(1e-6));
  CHECK(tip.drawn_in == Approx(0.033107).margin(1e-6));
  CHECK(tip.angle == Approx(0.321594).margin(1e-6));
}

TEST_CASE("A slender cantilever bends to the elastica", "[law][nightly]") {
  bend(2.0, GENERATE(false, true), 8, 1.0 / 240, 0.025);  // 0.02 is missed: docs/bars.md
}

TEST_CASE("A slender cantilever bends to the elastica in steps of a frame, too", "[law][nightly]") {
  bend(GENERATE(0.5, 2.0), GENERATE(false, true), 8, 1.0 / 24, 0.035);
}

TEST_CASE("A slender cantilever bends to the elastica, 12 cells across", "[law][nightly]") {
  bend(GENERATE(0.5, 2.0), GENERATE(false, true), 12, 1.0 / 240, 0.016);
}
