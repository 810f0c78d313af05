/* Purpose: a C11 program against the installed library that calls every function of the C API and checks what comes
 * back. Usage: client FOLDER (existing folder for the files it writes). Exit code: number of failed checks, at most
 * 100. It is built twice: with the headers of the day, and with those of an earlier release (0.2.0/). */
#include <eulerfsi/eulerfsi.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What the library has, against the header: the same, or at least that of an earlier release. */
#ifdef EFSI_EARLIER_HEADERS
#define HAS(library, header) ((library) >= (header))
#else
#define HAS(library, header) ((library) == (header))
#endif

static int failures = 0;

#define CHECK(condition)                                              \
  do {                                                                \
    if (!(condition)) {                                               \
      ++failures;                                                     \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
    }                                                                 \
  } while (0)
#define CHECK_OK(sim, call)                                                                        \
  do {                                                                                             \
    const EfsiStatus status_ = (call);                                                             \
    if (status_ != EFSI_OK) {                                                                      \
      ++failures;                                                                                  \
      fprintf(stderr, "%s:%d: %s: %s: %s\n", __FILE__, __LINE__, #call, efsi_status_text(status_), \
              (sim) ? efsi_simulation_last_error(sim) : "");                                       \
    }                                                                                              \
  } while (0)

/* A cube of edge 0.2 m around (0.3, 0.35, 0.3), quads wound counter-clockwise seen from outside. */
static const float kPoints[8][3] = {{0.2f, 0.25f, 0.2f}, {0.4f, 0.25f, 0.2f}, {0.4f, 0.45f, 0.2f}, {0.2f, 0.45f, 0.2f},
                                    {0.2f, 0.25f, 0.4f}, {0.4f, 0.25f, 0.4f}, {0.4f, 0.45f, 0.4f}, {0.2f, 0.45f, 0.4f}};
static const int32_t kCounts[6] = {4, 4, 4, 4, 4, 4};
static const int32_t kIndices[24] = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 3, 7, 6, 2, 0, 4, 7, 3, 1, 2, 6, 5};

static EfsiMeshView cube_view(void) {
  EfsiMeshView view;
  memset(&view, 0, sizeof view);
  view.points = &kPoints[0][0];
  view.point_count = 8;
  view.face_vertex_counts = kCounts;
  view.face_count = 6;
  view.face_vertex_indices = kIndices;
  view.index_count = 24;
  return view;
}

static void path_in(char* out, size_t size, const char* folder, const char* name) {
  snprintf(out, size, "%s/%s", folder, name);
}

static EfsiSimulationDef box_def(void) {
  EfsiSimulationDef def;
  CHECK_OK(NULL, efsi_simulation_def_init(&def, sizeof(def)));
  def.domain_size.x = def.domain_size.y = def.domain_size.z = 0.6;
  def.voxel_size = 0.04;
  def.gravity.y = -9.8;
  def.max_time_step = 0.005;
  def.threads = 2;
  def.energy_ledger = 1;
  return def;
}

/* A box with the cube and a smoke carpet; id receives the cube's. */
static EfsiSim* make_scene(uint32_t* id) {
  const EfsiSimulationDef def = box_def();
  EfsiError error = {EFSI_OK, ""};
  EfsiSim* sim = NULL;
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_OK);
  if (!sim) {
    fprintf(stderr, "efsi_simulation_create: %s\n", error.message);
    exit(100);
  }
  EfsiSolidDef solid;
  EfsiMeshReport report;
  CHECK_OK(NULL, efsi_solid_def_init(&solid, sizeof(solid)));
  solid.mesh = cube_view();
  solid.youngs_modulus = 2e4;
  CHECK_OK(sim, efsi_solid_add(sim, &solid, id));
  CHECK_OK(sim, efsi_solid_get_mesh_report(sim, *id, &report, sizeof(report)));
  CHECK(*id == 1 && report.closed == 1 && report.triangles == 12 && report.holes == 0);
  CHECK(fabs(report.surface_volume - 0.008) < 1e-8 && fabs(report.solid_volume / 0.008 - 1.0) < 0.04);

  EfsiEmitterDef carpet;
  uint32_t emitter = 0;
  CHECK_OK(NULL, efsi_emitter_def_init(&carpet, sizeof(carpet)));
  memset(carpet.transform, 0, sizeof carpet.transform);
  carpet.shape = EFSI_REGION_BOX;
  carpet.mode = EFSI_EMITTER_INITIAL;
  carpet.transform[0] = carpet.transform[10] = 0.6;
  carpet.transform[5] = 0.08;
  carpet.transform[3] = carpet.transform[11] = 0.3;
  carpet.transform[7] = 0.04;
  carpet.transform[15] = 1.0;
  carpet.density = 1.0;
  CHECK_OK(sim, efsi_emitter_add(sim, &carpet, &emitter));
  CHECK(emitter == 1);

  EfsiForceDef breeze;
  uint32_t force = 0;
  CHECK_OK(NULL, efsi_force_def_init(&breeze, sizeof(breeze)));
  memcpy(breeze.transform, carpet.transform, sizeof breeze.transform);
  breeze.kind = EFSI_FORCE_WIND;
  breeze.acts_on = EFSI_ACTS_ON_FLUID;
  breeze.wind_drag = 0.0;
  CHECK_OK(sim, efsi_force_add(sim, &breeze, &force));
  CHECK(force == 1);
  return sim;
}

static void check_refusals(void) {
  EfsiSimulationDef def = box_def();
  EfsiError error = {EFSI_OK, ""};
  EfsiSim* sim = NULL;

  def.voxel_size = -1.0;
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_ERROR_ARGUMENT && sim == NULL);
  CHECK(error.status == EFSI_ERROR_ARGUMENT && strstr(error.message, "voxel_size") && strstr(error.message, "-1"));
  memset(&def, 0, sizeof def); /* never initialised */
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_ERROR_ARGUMENT && sim == NULL);
  CHECK(efsi_simulation_create(NULL, &sim, NULL) == EFSI_ERROR_ARGUMENT);

  uint32_t id = 0, count = 0;
  sim = make_scene(&id);
  EfsiSolidDef solid;
  CHECK_OK(NULL, efsi_solid_def_init(&solid, sizeof(solid)));
  solid.mesh = cube_view();
  solid.density = -3.0;
  CHECK(efsi_solid_add(sim, &solid, &id) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "density") && strstr(efsi_simulation_last_error(sim), "-3"));
  CHECK_OK(sim, efsi_solid_get_count(sim, &count));
  CHECK(count == 1);
  EfsiSolidDiagnostics diagnostics;
  CHECK(efsi_solid_get_diagnostics(sim, 7, &diagnostics, sizeof(diagnostics)) == EFSI_ERROR_ARGUMENT);
  EfsiTransportError change;
  CHECK(efsi_solid_get_transport_error(sim, 7, &change, sizeof(change)) == EFSI_ERROR_ARGUMENT);
  efsi_simulation_destroy(sim);
  EfsiEnergyLedger ledger;
  def = box_def();
  def.energy_ledger = 0;
  CHECK_OK(NULL, efsi_simulation_create(&def, &sim, NULL));
  CHECK(efsi_simulation_get_energy_ledger(sim, &ledger, sizeof(ledger)) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "energy_ledger is 0"));
  efsi_simulation_destroy(sim);
  efsi_simulation_destroy(NULL);
}

/* What a definition tells before there is a simulation; the nearest point of a triangle. */
static void check_planning(void) {
  EfsiSimulationDef def = box_def();
  int32_t axis = 7;
  CHECK_OK(NULL, efsi_simulation_def_get_slab_axis(&def, &axis, NULL));
  CHECK(axis == -1);
  def.domain_size.z = def.voxel_size;
  CHECK_OK(NULL, efsi_simulation_def_get_slab_axis(&def, &axis, NULL));
  CHECK(axis == 2);
  EfsiStepLimits limits;
  CHECK_OK(NULL, efsi_simulation_def_get_step_limits(&def, 1000.0, &limits, sizeof(limits), NULL));
  CHECK(limits.contact_cfl > 0.0 && limits.contact_cfl < def.cfl_solid && limits.flight_cfl >= def.cfl_solid);
  def.preset = EFSI_PRESET_PAPER2016;
  CHECK_OK(NULL, efsi_simulation_def_get_step_limits(&def, 1000.0, &limits, sizeof(limits), NULL));
  CHECK(limits.contact_pace == 0.0 && fabs(limits.flight_cfl - def.cfl_solid) < 1e-12);
  EfsiError error;
  CHECK(efsi_simulation_def_get_step_limits(&def, 0.0, &limits, sizeof(limits), &error) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(error.message, "lightest_density = 0"));

  const double corners[18] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const double points[6] = {0.25, 0.25, 3.0, 2.0, 2.0, 0.0};
  uint32_t triangles[2] = {9, 9};
  double weights[6] = {0};
  CHECK_OK(NULL, efsi_triangles_find_nearest(corners, 2, points, 2, triangles, weights, NULL));
  CHECK(triangles[0] == 0 && fabs(weights[0] - 0.5) < 1e-12 && fabs(weights[1] - 0.25) < 1e-12);
  CHECK(triangles[1] == 1 && fabs(weights[4] - 1.0) < 1e-12);
  CHECK(efsi_triangles_find_nearest(corners, 0, points, 2, triangles, weights, &error) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(error.message, "triangle_count = 0"));
}

static void check_base_and_memory(void) {
  int32_t major = -1, minor = -1, patch = -1;
  CHECK_OK(NULL, efsi_version(&major, &minor, &patch));
  CHECK(HAS(10000 * major + 100 * minor + patch,
            10000 * EFSI_VERSION_MAJOR + 100 * EFSI_VERSION_MINOR + EFSI_VERSION_PATCH));
  for (EfsiStatus status = EFSI_OK; status <= EFSI_ERROR_CHECKPOINT; ++status)
    CHECK(efsi_status_text(status) && efsi_status_text(status)[0]);
  CHECK(efsi_status_text(-12345) != NULL);

  EfsiSimulationDef def = box_def();
  EfsiError error;
  uint64_t coarse = 0, fine = 0;
  double fitting = 0.0;
  CHECK_OK(NULL, efsi_simulation_estimate_memory(&def, 0.008, &coarse, &fitting, &error));
  def.voxel_size = 0.02;
  def.memory_limit = coarse;
  CHECK_OK(NULL, efsi_simulation_estimate_memory(&def, 0.008, &fine, &fitting, &error));
  CHECK(coarse > 0 && fine > 3 * coarse && fitting > def.voxel_size);
}

static int32_t go_on(void* user, double fraction) {
  CHECK(user == NULL && fraction >= 0.0 && fraction <= 1.0);
  return 0;
}

static void check_mesh(const char* folder) {
  char path[4096];
  path_in(path, sizeof path, folder, "cube.obj");
  FILE* file = fopen(path, "w");
  CHECK(file != NULL);
  if (!file) return;
  for (int i = 0; i < 8; ++i) fprintf(file, "v %g %g %g\n", kPoints[i][0], kPoints[i][1], kPoints[i][2]);
  for (int f = 0; f < 6; ++f)
    fprintf(file, "f %d %d %d %d\n", kIndices[4 * f] + 1, kIndices[4 * f + 1] + 1, kIndices[4 * f + 2] + 1,
            kIndices[4 * f + 3] + 1);
  fclose(file);

  EfsiMesh* mesh = NULL;
  EfsiError error = {EFSI_OK, ""};
  EfsiMeshView view;
  EfsiMeshReport report;
  CHECK_OK(NULL, efsi_mesh_load(path, &mesh, &error));
  if (mesh) {
    CHECK_OK(NULL, efsi_mesh_get_view(mesh, &view));
#ifndef EFSI_EARLIER_HEADERS
    EfsiMeshObject object;
    uint64_t objects = 0;
    CHECK_OK(NULL, efsi_mesh_get_objects(mesh, &object, sizeof(object), 1, &objects, &error));
    CHECK(objects == 1 && object.name[0] == '\0' && object.first_face == 0 && object.face_count == view.face_count);
#endif
    EfsiSurface* surface = NULL;
    double depth = 0.0, volume = 0.0;
    CHECK_OK(NULL, efsi_surface_create(&view, 0.04, 2, go_on, NULL, &surface, &error));
    CHECK_OK(NULL, efsi_surface_get_report(surface, &report, sizeof(report)));
    CHECK(report.closed == 1 && fabs(report.surface_volume - 0.008) < 1e-8);
    CHECK(report.repaired == 0 && strcmp(efsi_surface_get_repair_text(surface), "") == 0);
    CHECK_OK(NULL, efsi_surface_get_overlap(surface, surface, &depth, &volume, &error));
    CHECK(fabs(depth - 0.2) < 0.02 && fabs(volume - 0.008) < 0.0008);
    EfsiSurface* slab = NULL;
    CHECK_OK(NULL, efsi_surface_extrude_in_slab(surface, 2, 0.28, 0.32, &slab, &error));
    CHECK_OK(NULL, efsi_surface_get_report(slab, &report, sizeof(report)));
    CHECK(fabs(report.solid_volume - 0.2 * 0.2 * 0.04) < 1e-8);
    efsi_surface_destroy(slab);
    efsi_surface_destroy(surface);
    efsi_surface_destroy(NULL);
  }
  efsi_mesh_destroy(mesh);
  efsi_mesh_destroy(NULL);
  mesh = NULL;
  path_in(path, sizeof path, folder, "missing.obj");
  CHECK(efsi_mesh_load(path, &mesh, &error) == EFSI_ERROR_IO && mesh == NULL && strstr(error.message, "missing.obj"));
}

static int32_t count_and_go_on(void* user, double fraction, const EfsiStepInfo* step) {
  CHECK(fraction >= 0.0 && fraction <= 1.0 && step != NULL);
  ++*(int*)user;
  return 0;
}

static int32_t stop_at_once(void* user, double fraction, const EfsiStepInfo* step) {
  (void)user, (void)fraction, (void)step;
  return 1;
}

static void check_fields(EfsiSim* sim) {
  EfsiFieldView velocity, pressure;
  CHECK_OK(sim, efsi_field_get_view(sim, EFSI_FIELD_VELOCITY, 0, &velocity, sizeof(velocity)));
  CHECK(velocity.components == 3 && velocity.cell_centered == 0 && velocity.size[0] == 16 && velocity.stride[0] == 1);
  CHECK_OK(sim, efsi_field_get_view(sim, EFSI_FIELD_PRESSURE, 0, &pressure, sizeof(pressure)));
  CHECK(pressure.components == 1 && pressure.cell_centered == 1 && pressure.size[1] == 15);
  CHECK(fabs(pressure.spacing - 0.04) < 1e-12);

  EfsiFieldView smoke;
  CHECK_OK(sim, efsi_field_get_view(sim, EFSI_FIELD_SMOKE_DENSITY, 0, &smoke, sizeof(smoke)));
  const uint64_t count = (uint64_t)smoke.size[0] * (uint64_t)smoke.size[1] * (uint64_t)smoke.size[2];
  CHECK(count == 15u * 15u * 15u);
  float* values = malloc(count * sizeof *values);
  if (!values) exit(100);
  for (uint64_t i = 0; i < count; ++i) values[i] = 0.25f;
  CHECK(efsi_field_set(sim, EFSI_FIELD_SMOKE_DENSITY, 0, values, count - 1) == EFSI_ERROR_ARGUMENT);
  CHECK_OK(sim, efsi_field_set(sim, EFSI_FIELD_SMOKE_DENSITY, 0, values, count));
  free(values);
  CHECK_OK(sim, efsi_field_get_view(sim, EFSI_FIELD_SMOKE_DENSITY, 0, &smoke, sizeof(smoke)));
  CHECK(smoke.data[0] && smoke.data[0][3 + 4 * smoke.stride[1] + 5 * smoke.stride[2]] == 0.25f);
}

static void check_vdb(EfsiSim* sim, const char* folder) {
  char path[4096];
  EfsiVdbDef vdb;
  uint64_t first = 0, second = 0;
  CHECK_OK(NULL, efsi_vdb_def_init(&vdb, sizeof(vdb)));
  path_in(path, sizeof path, folder, "frame.0001.vdb");
  CHECK_OK(sim, efsi_vdb_write(sim, path, &vdb, &first));
  CHECK_OK(sim, efsi_vdb_write(sim, path, &vdb, &second));
  CHECK(first != 0 && first == second);
  FILE* file = fopen(path, "rb");
  CHECK(file != NULL);
  if (file) {
    unsigned char head[4] = {0};
    CHECK(fread(head, 1, 4, file) == 4 && memcmp(head, " BDV", 4) == 0); /* OpenVDB's magic number, little-endian */
    fclose(file);
  }
#ifndef EFSI_EARLIER_HEADERS
  EfsiVdb* vdb_file = NULL;
  EfsiVdbGrid grid;
  EfsiError error;
  CHECK_OK(NULL, efsi_vdb_open(path, &vdb_file, &error));
  CHECK_OK(NULL, efsi_vdb_get_grid(vdb_file, "density", &grid, sizeof(grid), &error));
  CHECK(grid.components == 1 && grid.active_count > 0);
  float corner = -1.0f;
  const uint32_t one[3] = {1, 1, 1};
  CHECK_OK(NULL, efsi_vdb_read(vdb_file, "density", grid.min, one, 1, &corner, 1, &error));
  CHECK(corner >= 0.0f);
  efsi_vdb_destroy(vdb_file);
#endif
  path_in(path, sizeof path, folder, "no/such/folder/frame.vdb");
  CHECK(efsi_vdb_write(sim, path, &vdb, NULL) == EFSI_ERROR_IO);
  CHECK(strstr(efsi_simulation_last_error(sim), "frame.vdb"));
}

/* The cube falls from rest for 0.1 s in a fluid of a thousandth of its density: g t (t + dt) / 2 = 0.051 m, the second
 * term from the first-order steps of at most 5 ms. */
static void check_fall(const char* folder) {
  uint32_t id = 0;
  EfsiSim* sim = make_scene(&id);
  EfsiStepInfo info;
  double time = -1.0;
  uint64_t steps = 0, hash_a = 0, hash_b = 0;
  int calls = 0;
  CHECK_OK(sim, efsi_simulation_step(sim, 0.01, &info, sizeof(info)));
  CHECK(info.steps == 1 && info.dt > 0.0 && info.dt <= 0.01 && info.time == info.dt);
  CHECK_OK(sim, efsi_simulation_get_time(sim, &time, &steps));
  CHECK(time == info.time && steps == 1);
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.05 - time, &info, sizeof(info), count_and_go_on, &calls));
  CHECK(fabs(info.time - 0.05) < 1e-12 && calls >= 1 && info.steps >= 1);

  char path[4096];
  path_in(path, sizeof path, folder, "state.checkpoint");
  CHECK_OK(sim, efsi_simulation_save_checkpoint(sim, path));
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.05, &info, sizeof(info), NULL, NULL));
  CHECK_OK(sim, efsi_simulation_get_hash(sim, &hash_a));

  EfsiSolidDiagnostics solid;
  EfsiFluidDiagnostics fluid;
  CHECK_OK(sim, efsi_solid_get_diagnostics(sim, id, &solid, sizeof(solid)));
  const double fallen = 0.35 - solid.center.y;
  CHECK(fallen > 0.047 && fallen < 0.054);
  CHECK(fabs(solid.center.x - 0.3) < 1e-3 && fabs(solid.center.z - 0.3) < 1e-3);
  CHECK(fabs(solid.volume_mesh / solid.rest_volume - 1.0) < 0.02 && solid.momentum.y < 0.0);
  CHECK_OK(sim, efsi_simulation_get_fluid_diagnostics(sim, &fluid, sizeof(fluid)));
  CHECK(fluid.kinetic_energy > 0.0 && fluid.smoke > 0.0);

  EfsiRepairs repairs;
  CHECK_OK(sim, efsi_simulation_get_repairs(sim, &repairs, sizeof(repairs)));
  CHECK(repairs.repaired_cells == 0 && repairs.min_det_f_before > 0.9 && repairs.max_det_f_before < 1.1);
  EfsiTransportError change;
  CHECK_OK(sim, efsi_solid_get_transport_error(sim, id, &change, sizeof(change)));
  CHECK(fabs(change.volume_mesh) < 1e-3 && fabs(change.momentum.y) < 0.01 * fabs(solid.momentum.y));
  CHECK(fabs(change.mass) < 0.01);
  EfsiEnergyLedger ledger;
  CHECK_OK(sim, efsi_simulation_get_energy_ledger(sim, &ledger, sizeof(ledger)));
  CHECK(fabs(ledger.at_end.solid_kinetic / solid.kinetic_energy - 1.0) < 1e-3);
  EfsiEnergy changes[EFSI_ENERGY_STAGE_COUNT];
  uint64_t known = 0;
  CHECK_OK(sim, efsi_simulation_get_energy_changes(sim, changes, EFSI_ENERGY_STAGE_COUNT, &known));
  CHECK(HAS(known, EFSI_ENERGY_STAGE_COUNT) && changes[EFSI_ENERGY_WEIGHT].solid_kinetic > 0.0);
  CHECK(changes[EFSI_ENERGY_SOLID_TRANSPORT].potential < 0.0);

  float points[24], velocities[24];
  CHECK_OK(sim, efsi_solid_get_surface(sim, id, points, velocities, 8));
  for (int i = 0; i < 8; ++i) {
    CHECK(fabs((double)points[3 * i + 1] - (double)kPoints[i][1] + fallen) < 0.02);
    CHECK(velocities[3 * i + 1] < -0.5f && velocities[3 * i + 1] > -1.5f);
  }
  CHECK(efsi_solid_get_surface(sim, id, points, velocities, 7) == EFSI_ERROR_ARGUMENT);

  /* What rides along in the middle of the cube and above its lid has fallen with it. */
  const float rest[6] = {0.3f, 0.35f, 0.3f, 0.3f, 0.5f, 0.3f}, far[3] = {0.3f, 0.9f, 0.3f};
  uint32_t passenger = 0;
  CHECK_OK(sim, efsi_passenger_add(sim, id, rest, 2, &passenger));
  CHECK_OK(sim, efsi_passenger_get_points(sim, passenger, points, velocities, 2));
  for (int i = 0; i < 2; ++i) {
    CHECK(fabs((double)points[3 * i + 1] - (double)rest[3 * i + 1] + fallen) < 0.01);
    CHECK(velocities[3 * i + 1] < -0.5f && velocities[3 * i + 1] > -1.5f);
  }
  CHECK(efsi_passenger_get_points(sim, passenger, points, NULL, 3) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_passenger_get_points(sim, 2, points, NULL, 2) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_passenger_add(sim, id, far, 1, &passenger) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "must be at most 6 voxels"));

  EfsiProfile profile;
  CHECK_OK(sim, efsi_simulation_get_profile(sim, &profile, sizeof(profile)));
  CHECK(profile.steps >= 3 && profile.total_seconds > 0.0 && profile.memory_bytes > 0);
  EfsiStageProfile stages[EFSI_STAGE_COUNT];
  CHECK_OK(sim, efsi_simulation_get_stages(sim, stages, sizeof(stages[0]), EFSI_STAGE_COUNT, &known));
  CHECK(HAS(known, EFSI_STAGE_COUNT) && stages[EFSI_STAGE_VELOCITY_SOLVE].tiles > 0);
  CHECK(stages[EFSI_STAGE_CONTACT].tiles == 0);
  CHECK_OK(sim, efsi_simulation_reset_profile(sim));
  CHECK_OK(sim, efsi_simulation_get_profile(sim, &profile, sizeof(profile)));
  CHECK(profile.steps == 0 && profile.total_seconds == 0.0);
  check_vdb(sim, folder);

  /* The checkpoint, in another simulation of the same scene, goes on to the same bits. */
  EfsiSim* twin = make_scene(&id);
  CHECK_OK(twin, efsi_simulation_restore_checkpoint(twin, path));
  CHECK_OK(twin, efsi_simulation_get_time(twin, &time, &steps));
  CHECK(fabs(time - 0.05) < 1e-12 && steps >= 2);
  CHECK(efsi_simulation_advance(twin, 0.05, &info, sizeof(info), stop_at_once, NULL) == EFSI_ERROR_CANCELLED);
  CHECK_OK(twin, efsi_simulation_restore_checkpoint(twin, path));
  CHECK_OK(twin, efsi_simulation_advance(twin, 0.05, &info, sizeof(info), NULL, NULL));
  CHECK_OK(twin, efsi_simulation_get_hash(twin, &hash_b));
  CHECK(hash_a == hash_b && hash_a != 0);
#ifndef EFSI_EARLIER_HEADERS
  /* The same goes on with other parameters, were there any. */
  CHECK_OK(twin, efsi_simulation_restore_state(twin, path));
  CHECK_OK(twin, efsi_simulation_advance(twin, 0.05, &info, sizeof(info), NULL, NULL));
  CHECK_OK(twin, efsi_simulation_get_hash(twin, &hash_b));
  CHECK(hash_a == hash_b);
#endif
  /* Its solid starts another simulation, where it is then. */
  EfsiSim* other = make_scene(&id);
  CHECK_OK(other, efsi_simulation_restore_solids(other, path));
  EfsiSolidDiagnostics start;
  CHECK_OK(other, efsi_solid_get_diagnostics(other, id, &start, sizeof(start)));
  CHECK_OK(other, efsi_simulation_get_time(other, &time, &steps));
  CHECK(fabs(start.center.y - 0.35 + 0.0125) < 0.002 && time == 0.0 && steps == 0);
  efsi_simulation_destroy(other);
  path_in(path, sizeof path, folder, "missing.checkpoint");
  CHECK(efsi_simulation_restore_checkpoint(twin, path) == EFSI_ERROR_IO);

  check_fields(twin);
  efsi_simulation_destroy(twin);
  efsi_simulation_destroy(sim);
}

/* The cube stands on a collider that comes up under it, pinned once by its lid and once by a volume: nothing moves but
 * what is told to. */
static void check_given_motion(void) {
  static const double kStay[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  double up[16], stretched[16];
  memcpy(up, kStay, sizeof up);
  memcpy(stretched, kStay, sizeof stretched);
  up[7] = 0.01;
  stretched[0] = 2.0;
  const EfsiSimulationDef def = box_def();
  EfsiError error = {EFSI_OK, ""};
  EfsiSim* sim = NULL;
  CHECK(efsi_simulation_create(&def, &sim, &error) == EFSI_OK);
  EfsiSolidDef solid;
  uint32_t id = 0, lid = 0, volume = 0, plate = 0, moved = 0;
  CHECK_OK(NULL, efsi_solid_def_init(&solid, sizeof(solid)));
  solid.mesh = cube_view();
  CHECK_OK(sim, efsi_solid_add(sim, &solid, &id));
  const uint8_t marked[8] = {0, 0, 1, 1, 0, 0, 1, 1}, none[8] = {0};
  CHECK_OK(sim, efsi_pin_add_vertices(sim, id, marked, 8, &lid));
  CHECK(efsi_pin_add_vertices(sim, id, none, 8, &lid) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "holds 0 nodes"));
  CHECK(efsi_pin_add_vertices(sim, id, marked, 7, &lid) == EFSI_ERROR_ARGUMENT);
  EfsiMeshView view = cube_view();
  EfsiSurface* surface = NULL;
  CHECK_OK(NULL, efsi_surface_create(&view, def.voxel_size, 1, NULL, NULL, &surface, &error));
  CHECK_OK(sim, efsi_pin_add_volume(sim, id, surface, &volume));
  efsi_surface_destroy(surface);
  float low[8][3];
  for (int i = 0; i < 8; ++i)
    for (int a = 0; a < 3; ++a) low[i][a] = kPoints[i][a] - (a == 1 ? 0.3f : 0.0f);
  solid.mesh.points = &low[0][0];
  CHECK_OK(sim, efsi_collider_add(sim, &solid, &plate, &moved)); /* from 0.05 m below the floor up */
  CHECK(id == 1 && lid == 1 && volume == 2 && plate == 2 && moved == 3);
  CHECK_OK(sim, efsi_pin_set_motion(sim, moved, 0.0, 0.04, kStay, up));
  CHECK(efsi_pin_set_motion(sim, moved, 0.0, 0.04, kStay, stretched) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "to: must be rigid"));
  CHECK(efsi_pin_set_motion(sim, moved, 0.04, 0.04, kStay, up) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_pin_set_motion(sim, 4, 0.0, 0.04, kStay, up) == EFSI_ERROR_ARGUMENT);
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.04, NULL, 0, NULL, NULL));
  float points[24];
  CHECK_OK(sim, efsi_solid_get_surface(sim, id, points, NULL, 8));
  for (int i = 0; i < 24; ++i) CHECK(fabs((double)(points[i] - kPoints[i / 3][i % 3])) < 1e-7);
  CHECK_OK(sim, efsi_solid_get_surface(sim, plate, points, NULL, 8));
  for (int i = 0; i < 8; ++i) CHECK(fabs((double)(points[3 * i + 1] - low[i][1]) - 0.01) < 1e-6);
  EfsiPinReaction reaction;
  CHECK_OK(sim, efsi_pin_get_reaction(sim, lid, &reaction, sizeof(reaction)));
  CHECK(reaction.impulse.y > 0.0);
  CHECK_OK(sim, efsi_pin_get_reaction(sim, moved, &reaction, sizeof(reaction)));
  CHECK(fabs(reaction.work - 0.25 * reaction.impulse.y) < 1e-3 * fabs(reaction.work)); /* 0.01 m in 0.04 s */
  CHECK(reaction.center.y > low[0][1] && reaction.center.y < low[0][1] + 1.0);
  CHECK(efsi_pin_get_reaction(sim, 4, &reaction, sizeof(reaction)) == EFSI_ERROR_ARGUMENT);
  /* Then its points rise by 0.01 m over where the pose has put them. */
  float high[8][3];
  for (int i = 0; i < 8; ++i)
    for (int a = 0; a < 3; ++a) high[i][a] = low[i][a] + (a == 1 ? 0.01f : 0.0f);
  CHECK_OK(sim, efsi_collider_set_points(sim, moved, 0.04, 0.08, &low[0][0], &high[0][0], 8));
  CHECK(efsi_collider_set_points(sim, moved, 0.04, 0.08, &low[0][0], &high[0][0], 7) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "point_count = 7: must be 8, as in the mesh of solid 2"));
  CHECK(efsi_collider_set_points(sim, lid, 0.04, 0.08, &low[0][0], &high[0][0], 8) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "must be that of a collider"));
  CHECK(efsi_collider_set_points(sim, moved, 0.08, 0.08, &low[0][0], &high[0][0], 8) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_collider_set_points(sim, moved, 0.04, 0.08, NULL, &high[0][0], 8) == EFSI_ERROR_ARGUMENT);
  high[5][2] = NAN;
  CHECK(efsi_collider_set_points(sim, moved, 0.04, 0.08, &low[0][0], &high[0][0], 8) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "to[5]: must be finite"));
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.04, NULL, 0, NULL, NULL));
  CHECK_OK(sim, efsi_solid_get_surface(sim, plate, points, NULL, 8));
  for (int i = 0; i < 8; ++i) CHECK(fabs((double)(points[3 * i + 1] - low[i][1]) - 0.02) < 1e-6);
  efsi_simulation_destroy(sim);
}

/* A cube that blows through an open face, from its first key to its last. */
static void check_jet(void) {
  EfsiSimulationDef def = box_def();
  def.wall[1] = EFSI_WALL_OPEN;
  def.max_time_step = 0.0;
  EfsiSim* sim = NULL;
  CHECK_OK(NULL, efsi_simulation_create(&def, &sim, NULL));
  if (!sim) exit(100);
  EfsiEmitterDef jet;
  CHECK_OK(NULL, efsi_emitter_def_init(&jet, sizeof(jet)));
  jet.has_velocity = 1;
  EfsiMeshView view = cube_view(); /* 0.2 m wide */
  EfsiSurface* surface = NULL;
  uint32_t id = 0;
  CHECK_OK(NULL, efsi_surface_create(&view, 2.0 * def.voxel_size, 1, NULL, NULL, &surface, NULL));
  CHECK(efsi_emitter_add_volume(sim, &jet, surface, &id) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "made for voxel_size"));
  efsi_surface_destroy(surface);
  CHECK_OK(NULL, efsi_surface_create(&view, def.voxel_size, 1, NULL, NULL, &surface, NULL));
  CHECK_OK(sim, efsi_emitter_add_volume(sim, &jet, surface, &id));
  efsi_surface_destroy(surface);
  CHECK(id == 1);
  EfsiEmitterKey keys[3] = {
      {0.0, 1.0, 0.0, {0, 0, 0}, 1, 0}, {0.04, 1.0, 0.0, {1, 0, 0}, 1, 0}, {0.08, 1.0, 0.0, {1, 0, 0}, 0, 0}};
  CHECK_OK(sim, efsi_emitter_set_keys(sim, id, keys, sizeof(EfsiEmitterKey), 3));
  CHECK(efsi_emitter_set_keys(sim, 2, keys, sizeof(EfsiEmitterKey), 3) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_emitter_set_keys(sim, id, keys, sizeof(EfsiEmitterKey), 0) == EFSI_ERROR_ARGUMENT);
  keys[2].time = 0.03;
  CHECK(efsi_emitter_set_keys(sim, id, keys, sizeof(EfsiEmitterKey), 3) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "keys[2].time = 0.03: must be >= 0.04"));
  double flux = -1.0;
  CHECK_OK(sim, efsi_emitter_get_flux(sim, id, &flux));
  CHECK(flux == 0.0);
  CHECK_OK(sim, efsi_simulation_step(sim, 0.04, NULL, 0));
  CHECK_OK(sim, efsi_emitter_get_flux(sim, id, &flux));
  CHECK(fabs(flux / 0.02 - 1.0) < 1e-3); /* half the speed over the first step */
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.04, NULL, 0, NULL, NULL));
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.04, NULL, 0, NULL, NULL));
  CHECK_OK(sim, efsi_emitter_get_flux(sim, id, &flux));
  CHECK(flux == 0.0);
  CHECK(efsi_emitter_get_flux(sim, id, NULL) == EFSI_ERROR_ARGUMENT);
  CHECK(efsi_emitter_set_keys(sim, id, keys, sizeof(EfsiEmitterKey), 2) == EFSI_ERROR_ARGUMENT); /* too late */
  efsi_simulation_destroy(sim);
}

/* The cube lies on another one on the floor: one pair, whose impulse is the upper one's weight. */
static void check_contacts(void) {
  EfsiSimulationDef def = box_def();
  def.ambient_fluid = 0;
  EfsiSim* sim = NULL;
  CHECK_OK(NULL, efsi_simulation_create(&def, &sim, NULL));
  if (!sim) exit(100);
  EfsiSolidDef solid;
  CHECK_OK(NULL, efsi_solid_def_init(&solid, sizeof(solid)));
  solid.youngs_modulus = 2e5;
  solid.rayleigh_beta = 2e-3;
  solid.friction = 0.5;
  uint32_t ids[2] = {0, 0};
  float points[8][3];
  for (int l = 0; l < 2; ++l) {
    memcpy(points, kPoints, sizeof points);
    for (int i = 0; i < 8; ++i) points[i][1] += (float)l * (0.2f + 0.25f * 0.04f) - 0.25f; /* the gap that they keep */
    solid.mesh = cube_view();
    solid.mesh.points = &points[0][0];
    CHECK_OK(sim, efsi_solid_add(sim, &solid, &ids[l]));
  }
  uint64_t count = 7;
  CHECK_OK(sim, efsi_simulation_get_contacts(sim, NULL, sizeof(EfsiContactPair), 0, &count));
  CHECK(count == 0);
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.3, NULL, 0, NULL, NULL));
  CHECK_OK(sim, efsi_simulation_advance(sim, 0.05, NULL, 0, NULL, NULL));
  EfsiContactPair pairs[2];
  memset(pairs, 0, sizeof pairs);
  CHECK_OK(sim, efsi_simulation_get_contacts(sim, pairs, sizeof(EfsiContactPair), 2, &count));
  CHECK(count == 1 && pairs[0].solid[0] == ids[0] && pairs[0].solid[1] == ids[1] && pairs[1].solid[0] == 0);
  EfsiSolidDiagnostics upper;
  CHECK_OK(sim, efsi_solid_get_diagnostics(sim, ids[1], &upper, sizeof(upper)));
  CHECK(fabs(pairs[0].impulse.y / (upper.mass * 9.8 * 0.05) - 1.0) < 0.1);
  CHECK(pairs[0].steps >= 10 && pairs[0].rows >= pairs[0].active_rows && pairs[0].active_rows >= pairs[0].steps);
  CHECK(pairs[0].sticking_rows <= pairs[0].active_rows && pairs[0].normal_impulse > 0.9 * pairs[0].impulse.y);
  CHECK(fabs(pairs[0].row_overlap) < 0.5 && pairs[0].surface_overlap < 0.0);
  CHECK(efsi_simulation_get_contacts(sim, NULL, sizeof(EfsiContactPair), 1, &count) == EFSI_ERROR_ARGUMENT);
  CHECK(strstr(efsi_simulation_last_error(sim), "pairs"));
  CHECK(efsi_simulation_get_contacts(sim, pairs, sizeof(EfsiContactPair), 2, NULL) == EFSI_ERROR_ARGUMENT);
  efsi_simulation_destroy(sim);
}

int main(int argc, char** argv) {
  if (argc != 2) {
    fprintf(stderr, "usage: client FOLDER\n");
    return 100;
  }
  check_base_and_memory();
  check_planning();
  check_mesh(argv[1]);
  check_refusals();
  check_fall(argv[1]);
  check_given_motion();
  check_jet();
  check_contacts();
  if (failures) fprintf(stderr, "%d checks failed\n", failures);
  return failures > 100 ? 100 : failures;
}
