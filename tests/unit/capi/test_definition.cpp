// Purpose: definitions: defaults, refused values, NULL and unknown ids.
#include <catch2/catch.hpp>
#include <cstring>
#include <functional>
#include <string>

#include "unit/capi/scene.hpp"

using namespace efsi::test;

namespace {

template <class Def>
struct Refusal {
  std::function<void(Def&)> change;
  std::string text;
};

}  // namespace

TEST_CASE("Definitions start with the defaults of the parameter table") {
  EfsiSimulationDef domain;
  std::memset(&domain, 0xff, sizeof(domain));
  REQUIRE(efsi_simulation_def_init(&domain, sizeof(domain)) == EFSI_OK);
  CHECK(domain.struct_size == sizeof(domain));
  CHECK(domain.voxel_size == 0.02);
  CHECK(domain.preset == EFSI_PRESET_PRODUCTION);
  CHECK(domain.wall[5] == EFSI_WALL_SLIP);
  CHECK(domain.ambient_fluid == 1);
  CHECK(domain.fluid_density == 1.0);
  CHECK(domain.cfl_solid == 1.8);
  CHECK(domain.cfl_fluid == 5.0);
  CHECK(domain.velocity_tolerance == 0.0);
  CHECK(domain.volume_source == 1);
  CHECK(domain.domain_size.z == 1.0);
  CHECK(domain.gravity.y == 0.0);
  CHECK(domain.log == nullptr);
  CHECK(domain.memory_limit == 0);

  EfsiSolidDef solid;
  std::memset(&solid, 0xff, sizeof(solid));
  REQUIRE(efsi_solid_def_init(&solid, sizeof(solid)) == EFSI_OK);
  CHECK(solid.magic == domain.magic);
  CHECK(solid.density == 1000.0);
  CHECK(solid.youngs_modulus == 20000.0);
  CHECK(solid.poissons_ratio == 0.3);
  CHECK(solid.material == EFSI_MATERIAL_COROTATIONAL);
  CHECK(solid.mesh.points == nullptr);

  EfsiEmitterDef emitter;
  std::memset(&emitter, 0xff, sizeof(emitter));
  REQUIRE(efsi_emitter_def_init(&emitter, sizeof(emitter)) == EFSI_OK);
  CHECK(emitter.mode == EFSI_EMITTER_CONTINUOUS);
  CHECK(emitter.density == 1.0);
  CHECK(emitter.end_time == 1e6);
  for (int i = 0; i < 16; ++i) CHECK(emitter.transform[i] == (i % 5 == 0 ? 1.0 : 0.0));

  EfsiVdbDef vdb;
  std::memset(&vdb, 0xff, sizeof(vdb));
  REQUIRE(efsi_vdb_def_init(&vdb, sizeof(vdb)) == EFSI_OK);
  CHECK(vdb.half_float == 0);
  CHECK(vdb.write_velocity == 1);
  CHECK((vdb.region_min.y < -1e300 && vdb.region_max.y > 1e300));
  for (int i = 0; i < 16; ++i) CHECK(vdb.transform[i] == (i % 5 == 0 ? 1.0 : 0.0));
}

TEST_CASE("Definitions that were not initialised are refused") {
  const Sim sim = scene();
  EfsiSim* other = nullptr;
  EfsiError error;
  EfsiSimulationDef domain{};
  CHECK(efsi_simulation_create(&domain, &other, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("EfsiSimulationDef") && Contains("efsi_simulation_def_init"));
  domain = box();
  domain.struct_size = 4;
  CHECK(efsi_simulation_create(&domain, &other, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("struct_size = 4: must be at least 8"));
  CHECK(other == nullptr);

  EfsiSolidDef solid{};
  CHECK(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("efsi_solid_def_init"));
  EfsiEmitterDef emitter{};
  CHECK(efsi_emitter_add(sim.get(), &emitter, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("efsi_emitter_def_init"));
  EfsiVdbDef vdb{};
  CHECK(efsi_vdb_write(sim.get(), "unused.vdb", &vdb, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("efsi_vdb_def_init"));
}

TEST_CASE("Values outside their limits are refused with field, value and limit") {
  const Refusal<EfsiSimulationDef> domain[] = {
      {[](auto& d) { d.voxel_size = -1.0; }, "EfsiSimulationDef.voxel_size = -1: must be > 0"},
      {[](auto& d) { d.voxel_size = kNan; }, "EfsiSimulationDef.voxel_size = nan: must be a finite number"},
      {[](auto& d) { d.domain_size.y = 0.0; }, "EfsiSimulationDef.domain_size.y = 0: must be > 0"},
      {[](auto& d) { d.domain_min.x = kNan; }, "EfsiSimulationDef.domain_min.x"},
      {[](auto& d) { d.gravity.z = kNan; }, "EfsiSimulationDef.gravity.z"},
      {[](auto& d) { d.preset = 3; }, "EfsiSimulationDef.preset = 3: must be between 0 and 2"},
      {[](auto& d) { d.wall[3] = 4; }, "EfsiSimulationDef.wall[3] = 4: must be between 0 and 3"},
      {[](auto& d) { d.wall[0] = -1; }, "EfsiSimulationDef.wall[0] = -1"},
      {[](auto& d) { d.wall[0] = EFSI_WALL_PERIODIC; }, "periodic on both faces"},
      {[](auto& d) { d.ambient_fluid = 7; }, "EfsiSimulationDef.ambient_fluid = 7: must be between 0 and 1"},
      {[](auto& d) { d.fluid_density = 0.0; }, "EfsiSimulationDef.fluid_density = 0: must be > 0"},
      {[](auto& d) { d.cfl_solid = 5000.0; }, "EfsiSimulationDef.cfl_solid = 5000: must be > 0 and at most 1000"},
      {[](auto& d) { d.max_time_step = -0.1; }, "EfsiSimulationDef.max_time_step = -0.1: must be >= 0"},
      {[](auto& d) { d.pressure_tolerance = 0.6; }, "EfsiSimulationDef.pressure_tolerance = 0.6"},
      {[](auto& d) { d.step_tolerance = -1.0; }, "EfsiSimulationDef.step_tolerance = -1: must be 0, or between 0.001"},
      {[](auto& d) { d.step_tolerance = 1e-9; },
       "EfsiSimulationDef.step_tolerance = 1e-09: must be 0, or between 0.001 and 10"},
      {[](auto& d) { d.threads = -1; }, "EfsiSimulationDef.threads = -1"},
  };
  for (const auto& refusal : domain) {
    EfsiSimulationDef def = box();
    refusal.change(def);
    EfsiSim* sim = nullptr;
    EfsiError error;
    CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_ERROR_ARGUMENT);
    CHECK(sim == nullptr);
    CHECK(error.status == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(error.message, Contains(refusal.text));
  }

  const Sim sim = create(box());
  const Refusal<EfsiSolidDef> solid[] = {
      {[](auto& d) { d.density = -3.0; }, "EfsiSolidDef.density = -3: must be > 0"},
      {[](auto& d) { d.youngs_modulus = 0.0; }, "EfsiSolidDef.youngs_modulus = 0: must be > 0"},
      {[](auto& d) { d.poissons_ratio = 0.5; }, "EfsiSolidDef.poissons_ratio = 0.5: must be between -0.9 and 0.499"},
      {[](auto& d) { d.rayleigh_beta = -1.0; }, "EfsiSolidDef.rayleigh_beta = -1: must be >= 0"},
      {[](auto& d) { d.friction = -1.0; }, "EfsiSolidDef.friction = -1: must be >= 0"},
      {[](auto& d) { d.contact_stiffness = -1.0; }, "EfsiSolidDef.contact_stiffness = -1: must be >= 0"},
      {[](auto& d) { d.plastic_yield_stress = -1.0; }, "EfsiSolidDef.plastic_yield_stress = -1: must be >= 0"},
      {[](auto& d) { d.plastic_flow_rate = 0.0; }, "EfsiSolidDef.plastic_flow_rate = 0: must be > 0"},
      {[](auto& d) { d.plastic_hardening = kNan; }, "EfsiSolidDef.plastic_hardening = nan"},
      {[](auto& d) { d.velocity.y = kNan; }, "EfsiSolidDef.velocity.y = nan"},
      {[](auto& d) { d.angular_velocity.x = kNan; }, "EfsiSolidDef.angular_velocity.x = nan"},
      {[](auto& d) { d.material = EFSI_MATERIAL_COUNT; },
       "EfsiSolidDef.material = " + std::to_string(EFSI_MATERIAL_COUNT)},
      {[](auto& d) { d.mesh.points = nullptr; }, "EfsiSolidDef.mesh.points is NULL"},
      {[](auto& d) { d.mesh.face_vertex_indices = nullptr; }, "EfsiSolidDef.mesh.face_vertex_indices is NULL"},
      {[](auto& d) { d.mesh.point_count = 0; }, "EfsiSolidDef.mesh.point_count = 0"},
      {[](auto& d) { d.mesh.point_stride = 8; }, "EfsiSolidDef.mesh.point_stride = 8: must be 0 or at least 12"},
      {[](auto& d) { d.mesh.face_vertex_counts = nullptr; }, "must be 3 * face_count"},
  };
  for (const auto& refusal : solid) {
    EfsiSolidDef def = cube_def();
    refusal.change(def);
    CHECK(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains(refusal.text));
  }
  const Refusal<EfsiForceDef> force[] = {
      {[](auto& d) { d.kind = 3; }, "EfsiForceDef.kind = 3"},
      {[](auto& d) { d.acts_on = -1; }, "EfsiForceDef.acts_on = -1"},
      {[](auto& d) { d.wind_drag = -1.0; }, "EfsiForceDef.wind_drag = -1: must be >= 0"},
      {[](auto& d) { d.noise_size = 0.0; }, "EfsiForceDef.noise_size = 0: must be > 0"},
      {[](auto& d) { d.acceleration.z = kNan; }, "EfsiForceDef.acceleration.z = nan"},
      {[](auto& d) { d.transform[0] = 0.0; }, "EfsiForceDef.transform: its determinant is 0"},
      {[](auto& d) { d.end_time = 0.5, d.start_time = 1.0; },
       "EfsiForceDef.end_time = 0.5: must be at least start_time"},
  };
  for (const auto& refusal : force) {
    EfsiForceDef def;
    REQUIRE(efsi_force_def_init(&def, sizeof(def)) == EFSI_OK);
    refusal.change(def);
    CHECK(efsi_force_add(sim.get(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains(refusal.text));
  }
  uint32_t count = 9;
  CHECK(efsi_solid_get_count(sim.get(), &count) == EFSI_OK);
  CHECK(count == 0);

  const Refusal<EfsiEmitterDef> emitter[] = {
      {[](auto& d) { d.density = -1.0; }, "EfsiEmitterDef.density = -1: must be >= 0"},
      {[](auto& d) { d.shape = EFSI_REGION_COUNT; }, "EfsiEmitterDef.shape = " + std::to_string(EFSI_REGION_COUNT)},
      {[](auto& d) { d.mode = -2; }, "EfsiEmitterDef.mode = -2"},
      {[](auto& d) { d.transform[5] = 0.0; }, "EfsiEmitterDef.transform: its determinant is 0: must be invertible"},
      {[](auto& d) { d.transform[3] = kNan; }, "EfsiEmitterDef.transform[3] = nan"},
      {[](auto& d) { d.transform[13] = 1.0; }, "EfsiEmitterDef.transform[13] = 1: must be 0"},
  };
  for (const auto& refusal : emitter) {
    EfsiEmitterDef def = carpet_def();
    refusal.change(def);
    CHECK(efsi_emitter_add(sim.get(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains(refusal.text));
  }
}

TEST_CASE("NULL is refused and never followed") {
  EfsiError error;
  const EfsiSimulationDef def = box();
  EfsiSim* none = nullptr;
  for (EfsiStatus status : {
           efsi_simulation_def_init(nullptr, 0),
           efsi_solid_def_init(nullptr, 0),
           efsi_emitter_def_init(nullptr, 0),
           efsi_vdb_def_init(nullptr, 0),
           efsi_simulation_create(nullptr, &none, nullptr),
           efsi_simulation_create(&def, nullptr, nullptr),
           efsi_mesh_load(nullptr, nullptr, nullptr),
           efsi_mesh_get_view(nullptr, nullptr),
           efsi_mesh_get_objects(nullptr, nullptr, 0, 0, nullptr, nullptr),
           efsi_surface_create(nullptr, 0.1, 0, nullptr, nullptr, nullptr, nullptr),
           efsi_surface_get_report(nullptr, nullptr, 0),
           efsi_surface_get_overlap(nullptr, nullptr, nullptr, nullptr, nullptr),
           efsi_surface_extrude_in_slab(nullptr, 2, 0.0, 0.1, nullptr, nullptr),
           efsi_simulation_estimate_memory(nullptr, 0.0, nullptr, nullptr, nullptr),
           efsi_simulation_step(nullptr, 0.1, nullptr, 0),
           efsi_simulation_advance(nullptr, 0.1, nullptr, 0, nullptr, nullptr),
           efsi_simulation_get_time(nullptr, nullptr, nullptr),
           efsi_simulation_get_hash(nullptr, nullptr),
           efsi_simulation_save_checkpoint(nullptr, "x"),
           efsi_simulation_restore_checkpoint(nullptr, "x"),
           efsi_simulation_restore_state(nullptr, "x"),
           efsi_simulation_restore_solids(nullptr, "x"),
           efsi_simulation_get_profile(nullptr, nullptr, 0),
           efsi_simulation_reset_profile(nullptr),
           efsi_simulation_get_fluid_diagnostics(nullptr, nullptr, 0),
           efsi_solid_add(nullptr, nullptr, nullptr),
           efsi_solid_get_count(nullptr, nullptr),
           efsi_solid_get_surface(nullptr, 1, nullptr, nullptr, 0),
           efsi_solid_get_diagnostics(nullptr, 1, nullptr, 0),
           efsi_emitter_add(nullptr, nullptr, nullptr),
           efsi_field_get_view(nullptr, 0, 0, nullptr, 0),
           efsi_field_set(nullptr, 0, 0, nullptr, 0),
           efsi_vdb_write(nullptr, nullptr, nullptr, nullptr),
       })
    CHECK(status == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_simulation_create(nullptr, &none, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("efsi_simulation_create: def is NULL"));
  CHECK(std::string(efsi_simulation_last_error(nullptr)).empty());
  efsi_simulation_destroy(nullptr);
  efsi_mesh_destroy(nullptr);

  const Sim sim = scene();
  EfsiSim* s = sim.get();
  CHECK(last_error(sim).empty());
  EfsiVdbDef vdb;
  efsi_vdb_def_init(&vdb, sizeof(vdb));
  for (EfsiStatus status :
       {efsi_solid_add(s, nullptr, nullptr), efsi_emitter_add(s, nullptr, nullptr), efsi_solid_get_count(s, nullptr),
        efsi_solid_get_diagnostics(s, 1, nullptr, 0), efsi_simulation_get_hash(s, nullptr),
        efsi_simulation_get_profile(s, nullptr, 0), efsi_simulation_get_fluid_diagnostics(s, nullptr, 0),
        efsi_field_get_view(s, 0, 0, nullptr, 0), efsi_field_set(s, 0, 0, nullptr, 1),
        efsi_simulation_save_checkpoint(s, nullptr), efsi_simulation_save_checkpoint(s, ""),
        efsi_simulation_restore_checkpoint(s, nullptr), efsi_simulation_restore_state(s, nullptr),
        efsi_simulation_restore_solids(s, nullptr), efsi_vdb_write(s, nullptr, &vdb, nullptr),
        efsi_vdb_write(s, "x.vdb", nullptr, nullptr)})
    CHECK(status == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("efsi_vdb_write: def is NULL"));
  CHECK(efsi_simulation_get_time(s, nullptr, nullptr) == EFSI_OK);
  CHECK(efsi_solid_get_surface(s, 1, nullptr, nullptr, 8) == EFSI_OK);
}

TEST_CASE("Unknown solids, fields and wrong times are refused") {
  const Sim sim = scene();
  EfsiSolidDiagnostics diagnostics;
  EfsiFieldView view;
  for (uint32_t id : {0u, 2u, 4000000000u}) {
    CHECK(efsi_solid_get_diagnostics(sim.get(), id, &diagnostics, sizeof(diagnostics)) == EFSI_ERROR_ARGUMENT);
    CHECK(efsi_solid_get_surface(sim.get(), id, nullptr, nullptr, 8) == EFSI_ERROR_ARGUMENT);
    CHECK(efsi_field_get_view(sim.get(), EFSI_FIELD_SOLID_VELOCITY, id, &view, sizeof(view)) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains("solid = " + std::to_string(id)));
  }
  CHECK(efsi_field_get_view(sim.get(), EFSI_FIELD_VELOCITY, 1, &view, sizeof(view)) == EFSI_ERROR_ARGUMENT);
  for (int32_t field : {-1, 7}) {
    CHECK(efsi_field_get_view(sim.get(), field, 0, &view, sizeof(view)) == EFSI_ERROR_ARGUMENT);
    CHECK_THAT(last_error(sim), Contains("field = " + std::to_string(field)));
  }
  for (double duration : {0.0, -1.0, kNan}) {
    CHECK(efsi_simulation_step(sim.get(), duration, nullptr, 0) == EFSI_ERROR_ARGUMENT);
    CHECK(efsi_simulation_advance(sim.get(), duration, nullptr, 0, nullptr, nullptr) == EFSI_ERROR_ARGUMENT);
  }
  const EfsiSolidDef solid = cube_def();
  const EfsiEmitterDef carpet = carpet_def();
  REQUIRE(efsi_simulation_step(sim.get(), 0.01, nullptr, 0) == EFSI_OK);
  CHECK(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("before the first step"));
  CHECK(efsi_emitter_add(sim.get(), &carpet, nullptr) == EFSI_ERROR_ARGUMENT);
}
