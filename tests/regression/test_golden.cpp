// Golden state hashes: small scenes whose final state is compared bit for bit with tests/regression/golden_hashes.txt.
// A change of results changes these lines and is named in CHANGELOG.md. With the environment variable
// EFSI_UPDATE_GOLDEN set to a file name the hashes of this build are written there.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "sim/checkpoint.hpp"
#include "sim/simulation.hpp"

using namespace efsi;

namespace {

geometry::TriangleMesh box(const Vec3d& low, const Vec3d& high) {
  geometry::TriangleMesh mesh;
  for (int c = 0; c < 8; ++c)
    mesh.points.push_back({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

std::string run(sim::Preset preset, bool fluid, bool solid, bool smoke) {
  sim::Params params;
  params.domain_min = Vec3d(0, 0, 0);
  params.domain_size = Vec3d(0.5, 0.6, 0.5);
  params.voxel_size = 0.03125;
  params.gravity = Vec3d(0, -9.8, 0);
  params.fluid.present = fluid;
  params.fluid.vorticity_confinement = 0.5;
  params.fluid.temperature_buoyancy = 0.1;
  params.threads = 2;
  params.numerics = sim::numerics_of(preset);
  sim::Simulation simulation(params, Log());
  if (solid) {
    sim::SolidDesc desc;
    desc.surface = box(Vec3d(0.13, 0.1, 0.15), Vec3d(0.36, 0.33, 0.37));
    desc.velocity = Vec3d(0.3, -1.0, 0.1);
    geometry::MeshReport report;
    simulation.add_solid(desc, report);
  }
  if (smoke) {
    fluid::Emitter emitter;
    emitter.from_world(0, 0) = emitter.from_world(1, 1) = emitter.from_world(2, 2) = 8.0;
    emitter.from_world.col(3).head<3>() = Vec3d(-2.0, -0.8, -2.0);
    emitter.temperature = 40.0;
    emitter.mode = fluid::Emitter::Mode::kContinuous;
    emitter.end_time = 10.0;
    simulation.add_emitter(emitter);
  }
  for (int frame = 0; frame < 5; ++frame) simulation.advance(1.0 / 24.0, {});
  std::ostringstream text;
  text << std::hex << sim::state_hash(simulation.state());
  return text.str();
}

}  // namespace

TEST_CASE("Golden state hashes are those of tests/regression/golden_hashes.txt", "[determinism]") {
  std::map<std::string, std::string> now;
  for (const auto& [name, preset] :
       {std::pair{"production", sim::Preset::kProduction}, std::pair{"paper2016", sim::Preset::kPaper2016}}) {
    now[std::string(name) + " solid_fluid_smoke"] = run(preset, true, true, true);
    now[std::string(name) + " smoke_only"] = run(preset, true, false, true);
    now[std::string(name) + " no_fluid"] = run(preset, false, true, false);
  }
  if (const char* path = std::getenv("EFSI_UPDATE_GOLDEN")) {
    std::ofstream out(path);
    for (const auto& [name, hash] : now) out << name << ' ' << hash << '\n';
  }
  std::ifstream in(EFSI_SOURCE_DIR "/tests/regression/golden_hashes.txt");
  REQUIRE(in);
  std::string preset, scene, hash;
  std::size_t lines = 0;
  while (in >> preset >> scene >> hash) {
    ++lines;
    INFO(preset << ' ' << scene);
    CHECK(now[preset + ' ' + scene] == hash);
  }
  CHECK(lines == now.size());
}
