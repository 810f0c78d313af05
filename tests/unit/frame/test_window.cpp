// Purpose: the part of the box that a step without fluid computes on.
#include <filesystem>
#include <random>

#include "frame/window.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using grid::Wall;
using sim::Window;

namespace {

// A box of 40 x 30 x 20 cells without fluid, solids by the cells of the box that are their elements.
struct Elements {
  sim::Params params = box_params({0.8, 0.6, 0.4});
  grid::Grid box = sim::make_grid(params);
  std::vector<solid::SolidState> solids;
  std::vector<solid::SolidWork> work;

  Elements() { params.fluid.present = false; }
  void add(const Vec3i& lo, const Vec3i& hi, const std::vector<Vec3i>& cells) {
    solid::SolidState state;
    state.band = solid::make_band(box, lo, hi);
    solid::SolidWork elements;
    const grid::Grid& band = state.band.grid;
    for (const Vec3i& c : cells)
      elements.element_cell.push_back(
          static_cast<std::int32_t>(band.cell(c[0] - band.lo[0], c[1] - band.lo[1], c[2] - band.lo[2])));
    solids.push_back(std::move(state));
    work.push_back(std::move(elements));
  }
  Window window() {
    box = sim::make_grid(params);
    return sim::choose_window(params, box, solids, work);
  }
};

SimulationPtr thrown_ball(int threads, sim::Preset preset = sim::Preset::kProduction) {
  sim::Params p = vacuum({0.6, 0.7, 0.5}, 0.025);
  p.threads = threads;
  p.numerics = sim::numerics_of(preset);
  sim::SolidDesc d = ball_desc({0.2, 0.5, 0.25});
  d.velocity = {1.5, -2.0, 0.3};
  d.angular_velocity = {0, 2, 4};
  return make_simulation(p, {d});
}

double farthest(const sim::Simulation& a, const sim::Simulation& b) {
  double worst = 0.0;
  const auto &x = a.state().solids[0].surface, &y = b.state().solids[0].surface;
  for (std::size_t i = 0; i < x.size(); ++i) worst = std::max(worst, (x[i] - y[i]).norm());
  return worst;
}

std::uint64_t tiles(const sim::Simulation& s) {
  std::uint64_t sum = 0;
  for (const std::uint64_t count : s.profile().tiles) sum += count;
  return sum;
}

}  // namespace

TEST_CASE("The window is what is near elements, in steps of four cells, cut at the box") {
  Elements e;
  CHECK(e.window() == Window{{0, 0, 0}, {4, 4, 4}});  // no solid
  e.add({10, 8, 0}, {20, 18, 10}, {{12, 10, 1}, {14, 11, 4}});
  CHECK(e.window() == Window{{11, 9, 0}, {8, 4, 8}});  // 5 x 4 x 6 cells with the margin of 1
  e.add({30, 20, 10}, {39, 28, 18}, {{38, 27, 12}});
  CHECK(e.window() == Window{{11, 9, 0}, {29, 20, 16}});  // 29 x 20 x 14; 32 do not fit
  e.params.walls.face[2] = e.params.walls.face[3] = Wall::kPeriodic;
  CHECK(e.window() == Window{{11, 0, 0}, {29, 30, 16}});
  e.params.fluid.present = true;
  CHECK(e.window() == Window{{0, 0, 0}, {40, 30, 20}});
}

TEST_CASE("Faces of the window keep the walls of the box where they are its faces") {
  sim::Params p = box_params({0.8, 0.6, 0.4});
  p.domain_min = {1.0, -2.0, 0.5};
  p.walls.face = {Wall::kNoSlip, Wall::kSlip, Wall::kPeriodic, Wall::kPeriodic, Wall::kSlip, Wall::kNoSlip};
  const grid::Grid box = sim::make_grid(p);
  const sim::CommonGrid part = sim::cut(p, box, {{8, 0, 4}, {32, 30, 8}});
  CHECK(part.walls.face ==
        std::array<Wall, 6>{Wall::kOpen, Wall::kSlip, Wall::kPeriodic, Wall::kPeriodic, Wall::kOpen, Wall::kOpen});
  CHECK(part.grid.cells == Vec3i{32, 30, 8});
  CHECK(part.grid.lo == Vec3i{8, 0, 4});
  CHECK(part.grid.node_position(2, 3, 1) == box.node_position(10, 3, 5));
  CHECK(part.grid.periodic == box.periodic);
  const sim::CommonGrid all = sim::cut(p, box, {{0, 0, 0}, box.cells});
  CHECK(all.walls.face == p.walls.face);
  CHECK(all.grid.origin == box.origin);
}

TEST_CASE("Cells keep their values from one window to another; new ones and ghosts hold 0") {
  const Window from{{2, 3, 4}, {5, 6, 7}};
  grid::Grid old;
  old.cells = from.cells;
  std::vector<Real> values(old.padded_count(), 99);  // ghosts too
  const auto value = [](int i, int j, int k) { return static_cast<Real>(1 + i + 20 * j + 400 * k); };
  for (int k = 0; k < 7; ++k)
    for (int j = 0; j < 6; ++j)
      for (int i = 0; i < 5; ++i) values[old.padded(i, j, k)] = value(i + 2, j + 3, k + 4);
  for (const Window& to :
       {Window{{0, 0, 0}, {12, 12, 12}}, Window{{4, 1, 6}, {6, 4, 3}}, Window{{7, 3, 4}, {2, 2, 2}}}) {
    grid::Grid g;
    g.cells = to.cells;
    const std::vector<Real> moved = sim::move_cells(values, from, to);
    REQUIRE(moved.size() == g.padded_count());
    int wrong = 0;
    for (int k = -1; k <= g.cells[2]; ++k)
      for (int j = -1; j <= g.cells[1]; ++j)
        for (int i = -1; i <= g.cells[0]; ++i) {
          const int at[3] = {i + to.lo[0], j + to.lo[1], k + to.lo[2]}, local[3] = {i, j, k};
          bool both = true;
          for (std::size_t a = 0; a < 3; ++a)
            both = both && local[a] >= 0 && local[a] < g.cells[a] && at[a] >= from.lo[a] &&
                   at[a] < from.lo[a] + from.cells[a];
          wrong += moved[g.padded(i, j, k)] != (both ? value(at[0], at[1], at[2]) : Real(0));
        }
    CHECK(wrong == 0);
  }
}

TEST_CASE("Without fluid the size of the box changes neither the motion nor the work", "[law]") {
  SimulationPtr runs[2];
  for (int large = 0; large < 2; ++large) {
    sim::Params p = vacuum(large ? Vec3d(1.5, 1.0, 1.25) : Vec3d(0.75, 0.5, 0.625), 0.015625);
    if (large) p.domain_min = {-0.25, 0.0, -0.4375};  // the floor stays where it is
    sim::SolidDesc d = ball_desc({0.3, 0.18, 0.3});
    d.velocity = {0.8, -2.0, 0.2};
    runs[large] = make_simulation(p, {d});
    for (int n = 0; n < 12; ++n) runs[large]->step(0.01);
  }
  const auto &small = *runs[0], &big = *runs[1];
  CHECK(small.state().solids[0].surface[0] != small.solids()[0].surface.points[0]);
  INFO("vertices apart by " << farthest(small, big) << " m");
  CHECK(farthest(small, big) == 0.0);  // places of nodes are exact here
  CHECK(tiles(big) == tiles(small));
  CHECK(static_cast<double>(big.memory_bytes()) < 1.01 * static_cast<double>(small.memory_bytes()));
}

TEST_CASE("A step on the window leaves what a step on the whole box does", "[law]") {
  // The slow twin: along periodic axes the window is the whole box. A ball bounces off the floor. The coupling step
  // follows a rough estimate, which depends on how the preconditioner coarsens the grid.
  SimulationPtr runs[2];
  for (int whole = 0; whole < 2; ++whole) {
    sim::Params p = vacuum({0.5, 0.5, 0.5}, 0.025);
    p.numerics.coupling_step = false;
    p.numerics.velocity_tolerance = 1e-6;
    p.numerics.pressure_tolerance = 1e-5;
    for (const std::size_t face : {0, 1, 4, 5}) p.walls.face[face] = whole ? Wall::kPeriodic : Wall::kOpen;
    sim::SolidDesc d = ball_desc({0.25, 0.14, 0.25});
    d.velocity = {0.3, -1.5, 0.2};
    runs[whole] = make_simulation(p, {d});
    for (int n = 0; n < 12; ++n) runs[whole]->step(0.01);
  }
  CHECK(runs[0]->state().window.cells[0] <= 12);
  CHECK(runs[1]->state().window.cells[0] == 20);
  const auto now = runs[0]->diagnose_solid(0);
  CHECK(now.extent_min[1] < 0.01);
  CHECK(now.elastic_energy > 0.01);
  INFO("vertices apart by " << farthest(*runs[0], *runs[1]) << " m");
  CHECK(farthest(*runs[0], *runs[1]) < 5e-5 * 0.2);  // rounding, which a bounce magnifies
}

TEST_CASE("A step that is repeated smaller starts from the window that it started from", "[determinism]") {
  const auto make = [](int threads) {
    sim::Params p = vacuum({0.5, 0.5, 0.5}, 0.025);
    p.cfl_solid = 4.0;
    p.threads = threads;
    sim::SolidDesc d = ball_desc({0.25, 0.25, 0.25});
    d.compressible = true;
    auto s = make_simulation(p, {d});
    const grid::Grid& g = s->state().solids[0].band.grid;  // squeezed to half its size
    std::vector<float> u(3 * g.node_count());
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i)
          for (int a = 0; a < 3; ++a)
            u[static_cast<std::size_t>(a) * g.node_count() + g.node(i, j, k)] =
                static_cast<float>(0.25 - g.node_position(i, j, k)[a]);
    s->set_solid_field(0, false, u.data());
    return s;
  };
  auto a = make(1), b = make(2);
  std::uint64_t retries = 0;
  for (int n = 0; n < 8; ++n) {
    const sim::State before = b->state();
    retries += a->step(1.0 / 24.0).retries;
    b->set_state(before);  // forgets what a step leaves in the workspace
    b->step(1.0 / 24.0);
    CHECK(sim::state_hash(a->state()) == sim::state_hash(b->state()));
  }
  CHECK(retries > 0);
}

TEST_CASE("Fields of a scene without fluid are those of the whole box") {
  auto s = thrown_ball(1);
  for (int n = 0; n < 3; ++n) s->step(0.02);
  const grid::Grid& g = s->grid();
  const std::vector<Real>& fraction = s->solid_fraction();
  const std::vector<Real>& pressure = s->pressure();
  REQUIRE(fraction.size() == g.cell_count());
  REQUIRE(pressure.size() == g.padded_count());
  CHECK(s->fluid_velocity().size() == g.node_count());
  const solid::SolidWork& work = s->workspace().solids[0];
  const grid::Grid& band = s->state().solids[0].band.grid;
  const auto now = s->diagnose_solid(0);
  double volume = 0.0, inside = 0.0;
  int outside = 0;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        volume += static_cast<double>(fraction[g.cell(i, j, k)]) * std::pow(g.h, 3);
        const double p = std::abs(static_cast<double>(pressure[g.padded(i, j, k)]));
        inside = std::max(inside, p);
        if (p > 0.0 && (g.cell_center(i, j, k) - now.center).norm() > 0.1 + 4 * g.h) ++outside;
      }
  CHECK(volume == Approx(now.volume_cells).epsilon(1e-5));
  CHECK(work.element_cell.size() < band.cell_count());
  CHECK(inside > 0.0);
  CHECK(outside == 0);
}
