// Golden state hashes: small scenes whose final state is compared bit for bit with tests/regression/golden_hashes.txt.
// A change of results changes these lines and is named in CHANGELOG.md. With the environment variable
// EFSI_UPDATE_GOLDEN set to a file name the hashes of this build are added to it.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "sim/checkpoint.hpp"
#include "sim/simulation.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;
using geometry::shapes::box;
using geometry::shapes::sphere;

namespace {

constexpr const char* kBunny = "/usr/share/glmark2/models/bunny.obj";  // Debian's package glmark2-data

// What a run did beside its state: a scene must do what it is here for.
struct Outcome {
  std::string hash;
  double lowest = 0.0, highest_speed = 0.0;  // of the solids' surfaces [m], of a solid during the run [m/s]
  std::uint64_t repaired = 0;                // degenerate cells
};

Outcome run(sim::Simulation& simulation, int frames) {
  Outcome outcome;
  outcome.lowest = simulation.params().domain_size[1];
  for (int frame = 0; frame < frames; ++frame) {
    const sim::StepInfo info = simulation.advance(1.0 / 24.0, {});
    outcome.repaired += info.degenerate_cells;
    outcome.highest_speed = std::max(outcome.highest_speed, info.max_speed_solid);
    for (const auto& solid : simulation.state().solids)
      for (const Vec3d& x : solid.surface) outcome.lowest = std::min(outcome.lowest, x[1]);
  }
  std::ostringstream text;
  text << std::hex << sim::state_hash(simulation.state());
  outcome.hash = text.str();
  return outcome;
}

sim::Params params(const Vec3d& size, double voxel) {
  sim::Params p;
  p.domain_size = size;
  p.voxel_size = voxel;
  p.gravity = Vec3d(0, -9.8, 0);
  p.fluid.vorticity_confinement = 0.5;
  p.threads = 1;
  return p;
}

void add(sim::Simulation& simulation, const geometry::TriangleMesh& mesh, const Vec3d& velocity, double modulus = 2e4,
         double density = 1000.0, const Vec3d& spin = Vec3d::Zero()) {
  sim::SolidDesc desc;
  desc.surface = mesh;
  desc.velocity = velocity;
  desc.angular_velocity = spin;
  desc.youngs_modulus = modulus;
  desc.density = density;
  geometry::MeshReport report;
  simulation.add_solid(desc, report);
}

// A box of 0.25 m filled with hot smoke over 10 s, centred at x = y = z = 0.25.
void add_smoke(sim::Simulation& simulation) {
  fluid::Emitter emitter;
  emitter.from_world(0, 0) = emitter.from_world(1, 1) = emitter.from_world(2, 2) = 8.0;
  emitter.from_world.col(3).head<3>() = Vec3d(-2.0, -0.8, -2.0);
  emitter.temperature = 40.0;
  emitter.mode = fluid::Emitter::Mode::kContinuous;
  emitter.end_time = 10.0;
  simulation.add_emitter(emitter);
}

// The three kinds of scene with either preset.
Outcome basic(sim::Preset preset, bool fluid, bool solid, bool smoke) {
  sim::Params p = params(Vec3d(0.5, 0.6, 0.5), 0.03125);
  p.fluid.present = fluid;
  p.fluid.temperature_buoyancy = 0.1;
  p.numerics = sim::numerics_of(preset);
  sim::Simulation simulation(p, Log());
  if (solid) {
    // Its triangles are cut along other diagonals than box() cuts them.
    geometry::TriangleMesh mesh = box(Vec3d(0.13, 0.1, 0.15), Vec3d(0.36, 0.33, 0.37));
    mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                      {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    add(simulation, mesh, Vec3d(0.3, -1.0, 0.1));
  }
  if (smoke) add_smoke(simulation);
  return run(simulation, 5);
}

// Two balls that fly into each other; one is ten times as stiff and half as dense.
Outcome touching() {
  sim::Simulation simulation(params(Vec3d(0.6, 0.5, 0.5), 0.025), Log());
  add(simulation, sphere(0.1, 8, Vec3d(0.19, 0.25, 0.25)), Vec3d(0.8, 0.0, 0.0));
  add(simulation, sphere(0.1, 8, Vec3d(0.41, 0.27, 0.25)), Vec3d(-0.8, 0.0, 0.0), 2e5, 500.0);
  Outcome outcome = run(simulation, 12);
  const auto& solids = simulation.state().solids;
  double gap = 1.0;  // between any two points of theirs
  for (const Vec3d& a : solids[0].surface)
    for (const Vec3d& b : solids[1].surface) gap = std::min(gap, (a - b).norm());
  CHECK(gap < 0.0375);  // triangles and the grid see a ball half a cell apart
  return outcome;
}

// The bunny of examples/scenes/falling_bunny.usda, thrown at the floor.
Outcome bunny() {
  sim::Params p = params(Vec3d(0.6, 0.8, 0.6), 0.025);
  p.walls.face.fill(grid::Wall::kNoSlip);
  sim::Simulation simulation(p, Log());
  const io::PolygonMesh file = io::read_mesh(kBunny);
  std::vector<Vec3d> points;
  for (const auto& x : file.points)  // turned by a 3-4-5 triangle, whose sine and cosine are the same everywhere
    points.push_back(Vec3d(0.3, 0.2, 0.3) + 0.125 * Vec3d(0.8 * x[0] - 0.6 * x[1], 0.6 * x[0] + 0.8 * x[1], x[2]));
  add(simulation, geometry::triangulate(points, file.face_vertex_counts, file.face_vertex_indices), Vec3d(0, -2, 0),
      2e5);
  add_smoke(simulation);
  Outcome outcome = run(simulation, 12);
  CHECK(outcome.lowest < 0.025);
  return outcome;
}

// A box of three different edges tumbles between periodic faces.
Outcome spinning_periodic() {
  sim::Params p = params(Vec3d(0.5, 0.5, 0.5), 0.03125);
  p.gravity.setZero();
  p.walls.face.fill(grid::Wall::kPeriodic);
  sim::Simulation simulation(p, Log());
  add(simulation, box(Vec3d(0.12, 0.15, 0.19), Vec3d(0.38, 0.35, 0.31)), Vec3d(0.04, 0.02, 0.0), 1e5, 1000.0,
      Vec3d(3.0, 6.0, -2.0));
  add_smoke(simulation);
  return run(simulation, 12);
}

// A ball of a tenth of the fluid's density rises.
Outcome light_solid() {
  sim::Params p = params(Vec3d(0.5, 0.6, 0.5), 0.025);
  p.fluid.density = 1000.0;
  sim::Simulation simulation(p, Log());
  add(simulation, sphere(0.1, 8, Vec3d(0.25, 0.2, 0.25)), Vec3d::Zero(), 2e4, 100.0);
  Outcome outcome = run(simulation, 12);
  CHECK(outcome.highest_speed > 0.3);
  return outcome;
}

// A box slides over the floor into a corner. wall: of all faces.
Outcome along_walls(grid::Wall wall) {
  sim::Params p = params(Vec3d(0.5, 0.5, 0.5), 0.025);
  p.walls.face.fill(wall);
  sim::Simulation simulation(p, Log());
  add(simulation, box(Vec3d(0.13, 0.01, 0.12), Vec3d(0.33, 0.16, 0.3)), Vec3d(-1.5, -0.5, -1.2));
  add_smoke(simulation);
  Outcome outcome = run(simulation, 12);
  CHECK(outcome.lowest < 0.01);
  return outcome;
}

// A very soft U is thrown at the floor until cells are put back in shape.
Outcome repair() {
  sim::Simulation simulation(params(Vec3d(0.5, 0.5, 0.5), 0.025), Log());
  geometry::TriangleMesh mesh;
  for (const double x : {0.12, 0.3})
    mesh = geometry::shapes::together(mesh, box(Vec3d(x, 0.06, 0.2), Vec3d(x + 0.07, 0.28, 0.28)));
  mesh = geometry::shapes::together(mesh, box(Vec3d(0.12, 0.06, 0.2), Vec3d(0.37, 0.13, 0.28)));
  add(simulation, mesh, Vec3d(1.0, -3.6, 0.3), 4e3);
  Outcome outcome = run(simulation, 12);
  CHECK(outcome.repaired > 0);
  return outcome;
}

// Compares with the committed line "preset scene hash".
void check(const std::string& scene, const Outcome& outcome) {
  if (const char* path = std::getenv("EFSI_UPDATE_GOLDEN"))
    std::ofstream(path, std::ios::app) << scene << ' ' << outcome.hash << '\n';
  std::ifstream in(EFSI_SOURCE_DIR "/tests/regression/golden_hashes.txt");
  REQUIRE(in);
  std::string preset, name, hash, expected = "no line";
  while (in >> preset >> name >> hash)
    if (preset + ' ' + name == scene) expected = hash;
  INFO(scene);
  CHECK(outcome.hash == expected);
}

}  // namespace

TEST_CASE("Golden hashes: the three kinds of scene with both presets", "[determinism]") {
  for (const auto& [name, preset] : {std::pair{std::string("production"), sim::Preset::kProduction},
                                     std::pair{std::string("paper2016"), sim::Preset::kPaper2016}}) {
    check(name + " solid_fluid_smoke", basic(preset, true, true, true));
    check(name + " smoke_only", basic(preset, true, false, true));
    check(name + " no_fluid", basic(preset, false, true, false));
  }
}
TEST_CASE("Golden hash: two solids that touch", "[determinism]") { check("production touching", touching()); }
TEST_CASE("Golden hash: the bunny falls", "[determinism]") {
  if (std::filesystem::exists(kBunny))
    check("production bunny", bunny());
  else
    WARN("skipped: no " << kBunny);
}
TEST_CASE("Golden hash: a body tumbles between periodic faces", "[determinism]") {
  check("production spinning_periodic", spinning_periodic());
}
TEST_CASE("Golden hash: a light solid rises", "[determinism]") { check("production light_solid", light_solid()); }
TEST_CASE("Golden hash: along slip walls", "[determinism]") {
  check("production slip_walls", along_walls(grid::Wall::kSlip));
}
TEST_CASE("Golden hash: along no-slip walls", "[determinism]") {
  check("production no_slip_walls", along_walls(grid::Wall::kNoSlip));
}
TEST_CASE("Golden hash: a repair happens", "[determinism]") { check("production repair", repair()); }
