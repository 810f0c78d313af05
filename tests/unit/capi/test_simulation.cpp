// Purpose: stepping, cancel, checkpoints, several simulations, the memory estimate.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "unit/capi/scene.hpp"

using namespace efsi::test;

TEST_CASE("Version and status texts speak for every status") {
  int32_t major = -1, minor = -1, patch = -1;
  CHECK(efsi_version(&major, &minor, &patch) == EFSI_OK);
  CHECK(efsi_version(nullptr, nullptr, nullptr) == EFSI_OK);
  CHECK(major == EFSI_VERSION_MAJOR);
  CHECK(minor == EFSI_VERSION_MINOR);
  CHECK(patch == EFSI_VERSION_PATCH);
  const std::string unknown = efsi_status_text(99);
  for (EfsiStatus status = EFSI_OK; status <= EFSI_ERROR_CHECKPOINT; ++status)
    CHECK(efsi_status_text(status) != unknown);
  CHECK(efsi_status_text(-1) == unknown);
}

TEST_CASE("Advance lands on the end and reports its progress") {
  const Sim sim = scene();
  EfsiStepInfo info;
  REQUIRE(efsi_simulation_step(sim.get(), 0.004, &info, sizeof(info)) == EFSI_OK);
  CHECK(info.steps == 1);
  CHECK(info.dt == 0.004);
  CHECK(info.time == 0.004);

  struct Calls {
    std::vector<double> fractions;
    uint64_t steps = 0;
  } calls;
  const EfsiProgressCallback record = [](void* user, double fraction, const EfsiStepInfo* step) -> int32_t {
    static_cast<Calls*>(user)->fractions.push_back(fraction);
    static_cast<Calls*>(user)->steps = step->steps;
    return 0;
  };
  REQUIRE(efsi_simulation_advance(sim.get(), 0.096, &info, sizeof(info), record, &calls) == EFSI_OK);
  CHECK(info.time == 0.004 + 0.096);
  CHECK(info.pressure_iterations > 0);
  REQUIRE(calls.fractions.size() == info.steps);
  CHECK(calls.steps == info.steps);
  CHECK(std::is_sorted(calls.fractions.begin(), calls.fractions.end()));
  CHECK(calls.fractions.back() == Approx(1.0));
  double time = 0.0;
  uint64_t steps = 0;
  REQUIRE(efsi_simulation_get_time(sim.get(), &time, &steps) == EFSI_OK);
  CHECK(time == info.time);
  CHECK(steps == info.steps + 1);

  float points[24], velocities[24];
  REQUIRE(efsi_solid_get_surface(sim.get(), 1, points, velocities, 8) == EFSI_OK);
  for (int p = 0; p < 8; ++p) {
    CHECK(points[3 * p + 1] < kPoints[3 * p + 1] - 0.03f);
    CHECK(velocities[3 * p + 1] == Approx(-0.98f).epsilon(0.1));
    CHECK(points[3 * p] == Approx(kPoints[3 * p]).margin(0.01));
  }
  CHECK(efsi_solid_get_surface(sim.get(), 1, points, velocities, 9) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("point_count = 9") && Contains("must be 8"));

  EfsiProfile profile;
  REQUIRE(efsi_simulation_get_profile(sim.get(), &profile, sizeof(profile)) == EFSI_OK);
  CHECK(profile.steps == steps);
  CHECK(profile.memory_bytes > 0);
  EfsiStageProfile stages[EFSI_STAGE_COUNT];
  REQUIRE(efsi_simulation_get_stages(sim.get(), stages, sizeof(stages[0]), EFSI_STAGE_COUNT, nullptr) == EFSI_OK);
  CHECK(stages[EFSI_STAGE_PRESSURE_SOLVE].tiles > 0);
  CHECK(stages[EFSI_STAGE_CONTACT].tiles == 0);
  double sum = 0.0;
  for (const EfsiStageProfile& stage : stages) sum += stage.seconds;
  CHECK(sum == Approx(profile.total_seconds));
  REQUIRE(efsi_simulation_reset_profile(sim.get()) == EFSI_OK);
  REQUIRE(efsi_simulation_get_profile(sim.get(), &profile, sizeof(profile)) == EFSI_OK);
  CHECK(profile.steps == 0);
  CHECK(profile.total_seconds == 0.0);
}

TEST_CASE("A cancelled advance leaves the state of the last completed step") {
  EfsiSimulationDef def = box();
  def.max_time_step = 0.01;
  const Sim sim = scene(def), twin = scene(def);
  int remaining = 3;
  const EfsiProgressCallback stop = [](void* user, double, const EfsiStepInfo*) -> int32_t {
    return --*static_cast<int*>(user) == 0;
  };
  EfsiStepInfo info;
  REQUIRE(efsi_simulation_advance(sim.get(), 0.1, &info, sizeof(info), stop, &remaining) == EFSI_ERROR_CANCELLED);
  CHECK(last_error(sim) != "");
  CHECK(info.steps == 3);
  double time = 0.0;
  uint64_t steps = 0;
  REQUIRE(efsi_simulation_get_time(sim.get(), &time, &steps) == EFSI_OK);
  CHECK(steps == 3);
  CHECK(time == info.time);
  for (int i = 0; i < 3; ++i) {
    double now = 0.0;
    REQUIRE(efsi_simulation_get_time(twin.get(), &now, nullptr) == EFSI_OK);
    REQUIRE(efsi_simulation_step(twin.get(), 0.1 - now, nullptr, 0) == EFSI_OK);
  }
  CHECK(hash_of(sim) == hash_of(twin));
  CHECK(efsi_simulation_advance(sim.get(), 0.1 - time, &info, sizeof(info), nullptr, nullptr) == EFSI_OK);
}

TEST_CASE("A checkpoint continues to the same state in another simulation") {
  const Folder folder;
  const std::string path = folder.file("ch\u00e9ck.point");
  const Sim sim = scene();
  REQUIRE(efsi_simulation_advance(sim.get(), 0.03, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  REQUIRE(efsi_simulation_save_checkpoint(sim.get(), path.c_str()) == EFSI_OK);
  CHECK(folder.files() == 1);
  const uint64_t saved = hash_of(sim);
  REQUIRE(efsi_simulation_advance(sim.get(), 0.03, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  CHECK(hash_of(sim) != saved);

  const Sim twin = scene();
  REQUIRE(efsi_simulation_restore_checkpoint(twin.get(), path.c_str()) == EFSI_OK);
  CHECK(hash_of(twin) == saved);
  REQUIRE(efsi_simulation_advance(twin.get(), 0.03, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  CHECK(hash_of(twin) == hash_of(sim));
  // Back in a simulation that has gone on.
  REQUIRE(efsi_simulation_restore_checkpoint(sim.get(), path.c_str()) == EFSI_OK);
  CHECK(hash_of(sim) == saved);

  EfsiSimulationDef heavy = box();
  heavy.gravity.y = -5.0;
  const Sim other = scene(heavy);
  CHECK(efsi_simulation_restore_checkpoint(other.get(), path.c_str()) == EFSI_ERROR_CHECKPOINT);
  CHECK_THAT(last_error(other), Contains(path));
  CHECK(efsi_simulation_restore_checkpoint(twin.get(), folder.file("missing").c_str()) == EFSI_ERROR_IO);
  CHECK(efsi_simulation_save_checkpoint(twin.get(), folder.file("no/such/folder").c_str()) == EFSI_ERROR_IO);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  CHECK(efsi_simulation_restore_checkpoint(sim.get(), path.c_str()) == EFSI_ERROR_IO);
  CHECK(hash_of(sim) == saved);
}

TEST_CASE("Two simulations in one process do not know of each other") {
  EfsiSimulationDef other = box();
  other.gravity = {3.0, 0.0, 0.0};
  const Sim a = scene(), b = scene(other), alone = scene();
  for (int i = 0; i < 3; ++i)
    for (const Sim* sim : {&a, &b})
      REQUIRE(efsi_simulation_advance(sim->get(), 0.02, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  for (int i = 0; i < 3; ++i)
    REQUIRE(efsi_simulation_advance(alone.get(), 0.02, nullptr, 0, nullptr, nullptr) == EFSI_OK);
  CHECK(hash_of(a) == hash_of(alone));
  CHECK(hash_of(a) != hash_of(b));
  CHECK(efsi_simulation_step(b.get(), -1.0, nullptr, 0) == EFSI_ERROR_ARGUMENT);
  CHECK(last_error(a).empty());
}

TEST_CASE("The memory estimate names the smallest voxel size that fits") {
  EfsiSimulationDef def = box();
  EfsiError error;
  uint64_t bytes = 0, at_fitting = 0;
  double fitting = -1.0;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.008, &bytes, &fitting, &error) == EFSI_OK);
  CHECK(fitting == 0.0);
  def.memory_limit = bytes / 2;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.008, nullptr, &fitting, &error) == EFSI_OK);
  CHECK(fitting > def.voxel_size);
  def.voxel_size = fitting;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.008, &at_fitting, nullptr, &error) == EFSI_OK);
  CHECK(at_fitting <= def.memory_limit);
  def.voxel_size = 0.999 * fitting;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.008, &at_fitting, nullptr, &error) == EFSI_OK);
  CHECK(at_fitting > def.memory_limit);

  def.voxel_size = 1e-9;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.008, &bytes, nullptr, &error) == EFSI_OK);
  CHECK(bytes == std::numeric_limits<uint64_t>::max());
  CHECK(efsi_simulation_estimate_memory(&def, -1.0, &bytes, nullptr, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("solid_volume = -1"));
  def.memory_limit = 1;
  CHECK(efsi_simulation_estimate_memory(&def, 0.008, nullptr, &fitting, &error) == EFSI_ERROR_MEMORY);

  def = box();
  def.ambient_fluid = 0;  // a larger box then costs nothing
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.001, &bytes, nullptr, &error) == EFSI_OK);
  for (double* edge : {&def.domain_size.x, &def.domain_size.y, &def.domain_size.z}) *edge *= 20;
  REQUIRE(efsi_simulation_estimate_memory(&def, 0.001, &at_fitting, nullptr, &error) == EFSI_OK);
  CHECK(at_fitting == bytes);
  EfsiSim* sim = nullptr;
  def.memory_limit = bytes;
  REQUIRE(efsi_simulation_create(&def, &sim, &error) == EFSI_OK);
  efsi_simulation_destroy(sim);
  def.ambient_fluid = 1;
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_ERROR_MEMORY);

  def = box();
  def.memory_limit = 1000;
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_ERROR_MEMORY);
  CHECK_THAT(error.message, Contains("voxel_size"));
}
