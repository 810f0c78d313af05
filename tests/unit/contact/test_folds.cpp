// Purpose: the folds of one solid stay apart, and push each other without making momentum or energy.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "contact/fold_contact.hpp"
#include "record/contact_record.hpp"
#include "solid/surface/fold_points.hpp"
#include "unit/geometry/shapes.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/hairpin.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

enum class Around { kVacuum, kAir, kLiquid };

// A U in the middle of a box without weight; its legs, seven cells from each other, are thrown at each other.
SimulationPtr closing_legs(Around around, double speed, int threads = 1) {
  sim::Params p = still({1.0, 0.8, 0.8}, kCell);
  p.energy_ledger = true;
  p.threads = threads;
  p.fluid.present = around != Around::kVacuum;
  if (around == Around::kLiquid) p.fluid.density = 1000.0 / 1.3;
  Hairpin pin;
  pin.gap = 7;
  pin.low = {17, 18, 6};
  sim::SolidDesc d = desc_of(pin.surface());
  d.density = 1000.0;
  d.youngs_modulus = 1e4;
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
  double impulse = 0.0, gained = 0.0, turned = 0.0;
  double solved = 0.0, most = 0.0;  // energy: what Eq. 8 and the pressure have added, its largest; over that at first
  std::uint64_t pushes = 0, repairs = 0;
};

// Least distance between vertices of the legs' inner faces, in the upper half [cells].
double between_tips(const sim::Simulation& s) {
  const std::vector<Vec3d>&rest = s.solids()[0].surface.points, &now = s.state().solids[0].surface;
  const geometry::Extents box = geometry::extents(s.solids()[0].surface);
  const double left = box.min[0] + 4 * kCell, right = box.max[0] - 4 * kCell, foot = 0.5 * (box.min[2] + box.max[2]);
  const auto on = [&](const Vec3d& X, double x) { return std::abs(X[0] - x) < 1e-6 && X[2] > foot; };
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < rest.size(); ++a)
    for (std::size_t b = 0; on(rest[a], left) && b < rest.size(); ++b)
      if (on(rest[b], right)) least = std::min(least, (now[b] - now[a]).norm() / kCell);
  return least;
}

Closing close(sim::Simulation& s, double end) {
  Closing out;
  s.step(1e-6);
  const auto before = s.diagnose_solid(0);
  double start = 0.0;
  while (s.state().time < end - 1e-9) {
    const sim::StepInfo info = s.step(std::min(0.02, end - s.state().time));
    out.repairs += info.repairs.repaired_cells;
    for (const sim::ContactPair& pair : info.contacts) {
      CHECK(pair.one == pair.other);
      CHECK(pair.sticking_rows == 0);
      out.impulse += pair.normal_impulse;
      ++out.pushes;
    }
    out.last = between_tips(s);
    out.nearest = std::min(out.nearest, out.last);
    const double energy = info.energy->at_end.sum();
    if (start == 0.0) start = energy;
    const auto at = [&](sim::EnergyStage stage) { return info.energy->change[static_cast<std::size_t>(stage)].sum(); };
    if (start > 0.0) out.solved += (at(sim::EnergyStage::kVelocity) + at(sim::EnergyStage::kPressure)) / start;
    out.most = std::max(out.most, energy / start);
  }
  const auto now = s.diagnose_solid(0);
  out.gained = (now.momentum - before.momentum).norm();
  out.turned = (now.angular_momentum - before.angular_momentum).norm();
  return out;
}

}  // namespace

TEST_CASE("Legs of a U that are thrown at each other stay apart and open again", "[law][slow]") {
  const Around around = GENERATE(Around::kVacuum, Around::kAir, Around::kLiquid);
  auto s = closing_legs(around, around == Around::kLiquid ? 1.2 : 0.8);
  const Closing out = close(*s, 0.5);
  INFO("fluid " << static_cast<int>(around) << ": nearest " << out.nearest << " cells, at the end " << out.last
                << ", impulse " << out.impulse << " N s, momentum gained " << out.gained << ", angular " << out.turned
                << ", energy: by solves " << out.solved << ", at most " << out.most << ", repairs " << out.repairs
                << ", pushes " << out.pushes);
  CHECK(out.pushes > 10);
  CHECK(out.nearest > 2.5);
  CHECK(out.nearest < 3.2);
  CHECK(out.last > out.nearest + 0.4);
  CHECK(out.repairs == 0);
  CHECK(out.most < 1.02);
  CHECK(out.solved < 0.0);
  CHECK(out.impulse > 0.1);
  if (around != Around::kVacuum) return;  // else the fluid has a part of them
  CHECK(out.gained < 1e-5 * out.impulse);
  CHECK(out.turned < 1e-5 * out.impulse);
}

TEST_CASE("Points near in space and far in the material are all found, and each pair once") {
  std::vector<solid::FoldPoint> points;
  solid::FoldPlaces places;
  const std::vector<float> values = noise(6 * 300, 2.0f);
  for (std::size_t i = 0; i < 300; ++i) {
    const float* v = values.data() + 6 * i;
    points.push_back({0, 0, 0, {v[0], v[1], v[2]}, {0, 0, 1}, 0});
    places.place.emplace_back(static_cast<double>(v[3]), static_cast<double>(v[4]), static_cast<double>(v[5]));
    places.normal.emplace_back(v[0], v[4], v[2]);
  }
  const double reach = 0.31, nearer = 1.5;
  std::vector<std::pair<int, int>> expected, found;
  for (int i = 0; i < 300; ++i)
    for (int j = i + 1; j < 300; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      const Vec3d rest(points[a].place[0] - points[b].place[0], points[a].place[1] - points[b].place[1],
                       points[a].place[2] - points[b].place[2]);
      const double now = (places.place[a] - places.place[b]).norm();
      if (now < reach && rest.norm() > nearer * now && places.normal[a].dot(places.normal[b]) < 0)
        expected.emplace_back(i, j);
    }
  for (const solid::NearPair& pair : solid::find_near_pairs(Parallel(2), points, places, reach, nearer))
    found.emplace_back(pair.one, pair.other);
  CHECK(expected.size() > 50);
  CHECK(found == expected);
}

TEST_CASE("A solid in its shape at rest, however it folds, has no row, limits no step and stores nothing", "[law]") {
  sim::Params p = still_vacuum({0.8, 0.8, 0.8}, kCell);
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
  solid::SolidWork work;
  sim::find_near_folds(Parallel(1), s->solids()[0], s->state().solids[0], work);
  CHECK(work.near_folds.empty());
  sim::visit_fold_gaps(s->state().solids[0], work, [](double, double) { FAIL("no part is near another"); });
  CHECK(!s->solids()[0].fold_points.empty());
  for (int i = 0; i < 3; ++i) {
    s->step(0.02);
    CHECK(s->workspace().elasticity.contacts.rows.empty());
  }
  CHECK(s->state().solids[0].contacts.empty());
  CHECK(s->diagnose_solid(0).elastic_energy == Approx(0.0).margin(1e-9));
}
