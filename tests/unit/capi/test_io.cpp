// Purpose: .vdb files: what they hold, read back by io/vdb_io, and their content hash.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "io/vdb_io.hpp"
#include "unit/capi/scene.hpp"

using namespace efsi::test;

TEST_CASE("A vdb file has a content hash that depends on values and transform alone") {
  const Folder folder;
  const Sim sim = scene();
  EfsiVdbDef def;
  REQUIRE(efsi_vdb_def_init(&def, sizeof(def)) == EFSI_OK);
  uint64_t first = 0, second = 0, moved = 0, still = 0, later = 0, nothing = 0;
  REQUIRE(efsi_vdb_write(sim.get(), folder.file("a.vdb").c_str(), &def, &first) == EFSI_OK);
  REQUIRE(efsi_vdb_write(sim.get(), folder.file("b.vdb").c_str(), &def, &second) == EFSI_OK);
  CHECK(first == second);
  CHECK(folder.files() == 2);
  EfsiVdbDef changed = def;
  changed.transform[3] = 2.0;
  REQUIRE(efsi_vdb_write(sim.get(), folder.file("b.vdb").c_str(), &changed, &moved) == EFSI_OK);
  CHECK(moved != first);
  changed = def;
  changed.write_velocity = 0;
  REQUIRE(efsi_vdb_write(sim.get(), folder.file("b.vdb").c_str(), &changed, &still) == EFSI_OK);
  CHECK(still != first);
  REQUIRE(efsi_simulation_advance(sim.get(), 0.05, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  REQUIRE(efsi_vdb_write(sim.get(), folder.file("b.vdb").c_str(), &def, &later) == EFSI_OK);
  CHECK(later != first);

  const Sim clear = create(box());
  REQUIRE(efsi_vdb_write(clear.get(), folder.file("clear.vdb").c_str(), &def, &nothing) == EFSI_OK);
  CHECK(nothing != first);
  CHECK(folder.files() == 3);

  CHECK(efsi_vdb_write(sim.get(), folder.file("no/such/x.vdb").c_str(), &def, nullptr) == EFSI_ERROR_IO);
  CHECK_THAT(last_error(sim), Contains("x.vdb"));
  changed = def;
  changed.transform[0] = 0.0;
  CHECK(efsi_vdb_write(sim.get(), folder.file("c.vdb").c_str(), &changed, nullptr) == EFSI_ERROR_ARGUMENT);
  changed = def;
  changed.half_float = 2;
  CHECK(efsi_vdb_write(sim.get(), folder.file("c.vdb").c_str(), &changed, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK(folder.files() == 3);
}

TEST_CASE("A vdb file holds smoke and velocity at the cell centres in world space") {
  const Folder folder;
  EfsiSimulationDef domain = box();
  domain.domain_min = {1.0, -0.3, 0.2};
  const Sim sim = create(domain);
  EfsiEmitterDef carpet = carpet_def();  // y in [-0.3, -0.2]
  carpet.transform[3] += 1.0;
  carpet.transform[7] -= 0.3;
  carpet.transform[11] += 0.2;
  carpet.density = 0.75;
  carpet.temperature = 30.0;
  REQUIRE(efsi_emitter_add(sim.get(), &carpet, nullptr) == EFSI_OK);

  // A velocity that is linear in space: its mean over a cell's corners is its value at the centre.
  const auto velocity = [](double x, double y, double z) { return std::array{1.0 + x, 2.0 * y - z, x + 3.0 * z}; };
  const EfsiFieldView nodes = view_of(sim, EFSI_FIELD_VELOCITY);
  std::vector<float> values;
  for_each_element(nodes, [&](int c, int i, int j, int k) {
    const double h = nodes.spacing;
    values.push_back(static_cast<float>(
        velocity(nodes.origin.x + h * i, nodes.origin.y + h * j, nodes.origin.z + h * k)[static_cast<std::size_t>(c)]));
  });
  REQUIRE(efsi_field_set(sim.get(), EFSI_FIELD_VELOCITY, 0, values.data(), values.size()) == EFSI_OK);

  // World: centimetres, y and z exchanged with a turn, moved.
  EfsiVdbDef def;
  REQUIRE(efsi_vdb_def_init(&def, sizeof(def)) == EFSI_OK);
  const double transform[16] = {100, 0, 0, 7, 0, 0, -100, 8, 0, 100, 0, 9, 0, 0, 0, 1};
  std::copy(transform, transform + 16, def.transform);
  uint64_t hash = 0;
  const std::string path = folder.file("smoke.vdb");
  REQUIRE(efsi_vdb_write(sim.get(), path.c_str(), &def, &hash) == EFSI_OK);

  const efsi::io::VdbSummary summary = efsi::io::read_vdb_summary(path);
  CHECK(summary.content_hash == hash);
  REQUIRE(summary.grids.size() == 3);
  for (const auto& grid : summary.grids) {
    CHECK(grid.active_voxels == 12 * 2 * 12);
    // The centre of cell (0,0,0), (1.025, -0.275, 0.225) m, and one step along the cells' x, y, z.
    const double expected[16] = {5, 0, 0, 109.5, 0, 0, -5, -14.5, 0, 5, 0, -18.5, 0, 0, 0, 1};
    for (std::size_t i = 0; i < 16; ++i) CHECK(grid.index_to_world[i] == Approx(expected[i]).margin(1e-9));
  }
  const efsi::Vec3i size = {12, 12, 12};
  const auto density = efsi::io::read_vdb_values(path, "density", size);
  const auto temperature = efsi::io::read_vdb_values(path, "temperature", size);
  const auto vel = efsi::io::read_vdb_values(path, "vel", size);
  REQUIRE(vel.size() == 3 * 12 * 12 * 12);
  double worst = 0.0;
  for (int k = 0; k < 12; ++k)
    for (int j = 0; j < 12; ++j)
      for (int i = 0; i < 12; ++i) {
        const auto c = static_cast<std::size_t>(i + 12 * (j + 12 * k));
        const double smoke = j < 2 ? 1.0 : 0.0;
        const auto v = velocity(1.025 + 0.05 * i, -0.275 + 0.05 * j, 0.225 + 0.05 * k);
        worst = std::max({worst, std::abs(density[c] - 0.75 * smoke), std::abs(temperature[c] - 30.0 * smoke),
                          std::abs(vel[3 * c] - 100.0 * smoke * v[0]), std::abs(vel[3 * c + 1] + 100.0 * smoke * v[2]),
                          std::abs(vel[3 * c + 2] - 100.0 * smoke * v[1])});
      }
  CHECK(worst < 1e-3);

  const Sim clear = create(box());
  REQUIRE(efsi_vdb_write(clear.get(), path.c_str(), &def, nullptr) == EFSI_OK);
  const efsi::io::VdbSummary nothing = efsi::io::read_vdb_summary(path);
  REQUIRE(nothing.grids.size() == 2);
  for (const auto& grid : nothing.grids) CHECK(grid.active_voxels == 0);
}
