// Purpose: the folds of one solid stay apart, and push each other without making momentum or energy.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "sim/contact_record.hpp"
#include "sim/fold_contact.hpp"
#include "unit/geometry/shapes.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/hairpin.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kCell = 0.02;

enum class Around { kVacuum, kAir, kLiquid };

// A U in the middle of a box without weight; its legs, `apart` cells from each other, are thrown at each other.
std::unique_ptr<sim::Simulation> closing_legs(Around around, double speed, int apart = 12) {
  sim::Params p = box_params({1.0, 0.8, 0.8}, kCell);
  p.gravity.setZero();
  p.energy_ledger = true;
  p.fluid.present = around != Around::kVacuum;
  if (around == Around::kLiquid) p.fluid.density = 1000.0 / 1.3;
  Hairpin pin;
  pin.gap = apart;
  pin.low = {17, 18, 6};
  sim::SolidDesc d;
  d.surface = pin.surface();
  d.density = 1000.0;
  d.youngs_modulus = 4e3;
  d.poissons_ratio = 0.3;
  auto s = make_simulation(p, {d});
  solid::SolidState state = s->state().solids[0];
  const grid::Grid& g = state.band.grid;
  const double middle = kCell * (pin.low[0] + 4 + 0.5 * pin.gap), foot = kCell * (pin.low[2] + 4), leg = 23 * kCell;
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const auto [i, j, k] = g.node_place(n);
    const Vec3d x = g.node_position(i, j, k);
    const double up = std::max(0.0, (x[2] - foot) / leg), side = std::clamp((x[0] - middle) / (5 * kCell), -1.0, 1.0);
    state.v.set(n, Vec3(static_cast<Real>(-speed * side * up * up), 0, 0));
  }
  state.speed = speed;
  s->set_solids({state});
  return s;
}

struct Closing {
  double nearest = 1e30, last = 0.0;  // least distance of the legs' inner faces, and at the end [cells]
  double impulse = 0.0, gained = 0.0, turned = 0.0, made = 0.0;
  std::uint64_t pushes = 0, repairs = 0;
};

Closing close(sim::Simulation& s, double end) {
  Closing out;
  s.step(1e-6);
  const auto before = s.diagnose_solid(0);
  const solid::SolidRest& rest = s.solids()[0];
  double last = 0.0, start = 0.0;
  while (s.state().time < end - 1e-9) {
    const sim::StepInfo info = s.step(std::min(0.02, end - s.state().time));
    out.repairs += info.repairs.put_back;
    for (const sim::ContactPair& pair : info.contacts) {
      CHECK(pair.one == pair.other);
      CHECK(pair.sticking == 0);
      out.impulse += pair.push;
      ++out.pushes;
    }
    // The tips' inner faces: points of one against those of the other at the same height.
    out.last = 1e30;
    double low = 1e30, high = -1e30, middle_low = 0, middle_high = 1e30;
    for (const Vec3d& X : rest.surface.points) low = std::min(low, X[0]), high = std::max(high, X[0]);
    middle_low = low + 4 * kCell, middle_high = high - 4 * kCell;
    for (std::size_t a = 0; a < rest.surface.points.size(); ++a) {
      const Vec3d& X = rest.surface.points[a];
      if (std::abs(X[0] - middle_low) > 1e-6 || X[2] < 0.5) continue;
      for (std::size_t b = 0; b < rest.surface.points.size(); ++b)
        if (std::abs(rest.surface.points[b][0] - middle_high) < 1e-6 && rest.surface.points[b][2] > 0.5)
          out.last =
              std::min(out.last, (s.state().solids[0].surface[b] - s.state().solids[0].surface[a]).norm() / kCell);
    }
    out.nearest = std::min(out.nearest, out.last);
    const double energy = info.energy->end.sum();
    if (start == 0.0)
      start = energy;
    else
      out.made = std::max(out.made, (energy - last) / start);
    last = energy;
  }
  const auto now = s.diagnose_solid(0);
  out.gained = (now.momentum - before.momentum).norm();
  out.turned = (now.angular_momentum - before.angular_momentum).norm();
  return out;
}

}  // namespace

TEST_CASE("Legs of a U that are thrown at each other stay apart and open again", "[law]") {
  const Around around = GENERATE(Around::kVacuum, Around::kAir, Around::kLiquid);
  auto s = closing_legs(around, around == Around::kLiquid ? 4.0 : 2.0);
  const Closing out = close(*s, 0.5);
  INFO("fluid " << static_cast<int>(around) << ": nearest " << out.nearest << " cells, at the end " << out.last
                << ", impulse " << out.impulse << " N s, momentum gained " << out.gained << ", angular " << out.turned
                << ", energy made " << out.made << ", repairs " << out.repairs << ", pushes " << out.pushes);
  WARN("fluid " << static_cast<int>(around) << ": nearest " << out.nearest << " cells, at the end " << out.last
                << ", impulse " << out.impulse << " N s, momentum gained " << out.gained << ", angular " << out.turned
                << ", energy made " << out.made << ", repairs " << out.repairs << ", pushes " << out.pushes);
  CHECK(out.pushes > 3);
  CHECK(out.nearest > 1.0);
  CHECK(out.nearest < 3.0);
  CHECK(out.last > out.nearest + 1.0);
  CHECK(out.repairs == 0);
  CHECK(out.made < 0.02);
}

TEST_CASE("A solid in its shape at rest, however it folds, has no row, limits no step and stores nothing", "[law]") {
  sim::Params p = box_params({0.8, 0.8, 0.8}, kCell);
  p.gravity.setZero();
  p.fluid.present = false;
  sim::SolidDesc d;
  SECTION("a U") {
    Hairpin pin;
    pin.gap = GENERATE(1, 2, 3, 6);
    d.surface = pin.surface();
  }
  SECTION("a torus") {
    d.surface = geometry::shapes::torus(0.12, 0.09, 48, 24);
    for (Vec3d& x : d.surface.points) x += Vec3d::Constant(0.4);
  }
  SECTION("meshes of others") {
    const char* file = GENERATE("stanford-bunny.obj", "spot.obj", "suzanne.obj", "teapot.obj");
    const auto mesh = geometry::shapes::shared_mesh(file);
    if (!mesh) return;
    d.surface = *mesh;
    const geometry::Extents box = geometry::extents(d.surface);
    for (Vec3d& x : d.surface.points)
      x = Vec3d::Constant(0.4) + 0.5 / (box.max - box.min).maxCoeff() * (x - 0.5 * (box.min + box.max));
  }
  auto s = make_simulation(p, {d});
  const sim::SolidGap gap = sim::measure_folds(Parallel(1), s->solids()[0], s->state().solids[0]);
  CHECK(!std::isfinite(gap.gap));
  CHECK(gap.closing == 0.0);
  CHECK(!s->solids()[0].fold_points.empty());
  for (int i = 0; i < 3; ++i) {
    s->step(0.02);
    CHECK(s->workspace().elasticity.contacts.rows.empty());
  }
  CHECK(s->state().solids[0].contacts.empty());
  CHECK(s->diagnose_solid(0).elastic_energy == Approx(0.0).margin(1e-9));
}
