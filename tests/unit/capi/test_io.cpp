// Purpose: .vdb files: what they hold, read back by io/vdb_io, and their content hash.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "io/vdb_io.hpp"
#include "unit/capi/scene.hpp"
#include "unit/io/vdb_values.hpp"

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
  const auto density = efsi::io::vdb_values(path, "density", size);
  const auto temperature = efsi::io::vdb_values(path, "temperature", size);
  const auto vel = efsi::io::vdb_values(path, "vel", size);
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

TEST_CASE("A vdb file is read through the API, and a region of it is written alone") {
  const Folder folder;
  const Sim sim = scene();
  EfsiVdbDef def;
  REQUIRE(efsi_vdb_def_init(&def, sizeof(def)) == EFSI_OK);
  const std::string path = folder.file("a.vdb");
  EfsiError error;
  EfsiVdb* vdb = nullptr;
  EfsiVdbGrid whole, part;
  const auto grid_of = [&](EfsiVdbGrid& grid) {
    REQUIRE(efsi_vdb_write(sim.get(), path.c_str(), &def, nullptr) == EFSI_OK);
    REQUIRE(efsi_vdb_open(path.c_str(), &vdb, &error) == EFSI_OK);
    REQUIRE(efsi_vdb_get_grid(vdb, "density", &grid, sizeof(grid), &error) == EFSI_OK);
  };
  grid_of(whole);
  REQUIRE((whole.components == 1 && whole.size[0] > 2 && whole.active_count > 0));
  std::vector<float> values(static_cast<std::size_t>(whole.size[0]) * whole.size[1] * whole.size[2]);
  REQUIRE(efsi_vdb_read(vdb, "density", whole.min, whole.size, 1, values.data(), values.size(), &error) == EFSI_OK);
  CHECK(std::count_if(values.begin(), values.end(), [](float v) { return v > 0.0f; }) ==
        static_cast<std::ptrdiff_t>(whole.active_count));
  CHECK(efsi_vdb_read(vdb, "density", whole.min, whole.size, 1, values.data(), 1, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("a.vdb: grid 'density': number of values"));
  const uint32_t huge[3] = {0xffffffffu, 1, 1};
  CHECK(efsi_vdb_read(vdb, "density", whole.min, huge, 1, values.data(), values.size(), &error) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_vdb_get_grid(vdb, "heat", &whole, sizeof(whole), &error) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_vdb_get_grid(nullptr, "density", &whole, sizeof(whole), &error) == EFSI_ERROR_ARGUMENT);
  efsi_vdb_destroy(vdb);
  CHECK(efsi_vdb_open(nullptr, &vdb, &error) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_vdb_open(folder.file("none.vdb").c_str(), &vdb, &error) == EFSI_ERROR_IO);
  CHECK(vdb == nullptr);

  // The upper half along x: cells whose centres are there.
  grid_of(whole);
  efsi_vdb_destroy(vdb);
  def.region_min.x = whole.transform[3] + whole.transform[0] * (whole.min[0] + 1.5);
  grid_of(part);
  efsi_vdb_destroy(vdb);
  CHECK((part.min[0] == whole.min[0] + 2 && part.size[0] == whole.size[0] - 2));
  def.region_max.x = def.region_min.x;
  CHECK(efsi_vdb_write(sim.get(), path.c_str(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("EfsiVdbDef.region_min.x"));
}
