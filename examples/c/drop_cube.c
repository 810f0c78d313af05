/* Purpose: the smallest useful program: drops an elastic cube into smoke and writes one .vdb and one .obj per frame.
 * Usage: drop_cube [FOLDER [FRAMES]]; without a folder nothing is written. Exit code 1 when a call fails or the cube
 * does not fall as it should. */
#include <eulerfsi/eulerfsi.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static EfsiSim* sim = NULL;

/* Stops the program with the library's message when a call fails. */
static void require(EfsiStatus status, const char* what) {
  if (status == EFSI_OK) return;
  fprintf(stderr, "%s: %s: %s\n", what, efsi_status_text(status), sim ? efsi_simulation_last_error(sim) : "");
  efsi_simulation_destroy(sim);
  exit(1);
}

static const float kPoints[] = {0.2f, 0.3f, 0.2f, 0.4f, 0.3f, 0.2f, 0.4f, 0.5f, 0.2f, 0.2f, 0.5f, 0.2f,
                                0.2f, 0.3f, 0.4f, 0.4f, 0.3f, 0.4f, 0.4f, 0.5f, 0.4f, 0.2f, 0.5f, 0.4f};
static const int32_t kCounts[] = {4, 4, 4, 4, 4, 4};
static const int32_t kIndices[] = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 3, 7, 6, 2, 0, 4, 7, 3, 1, 2, 6, 5};

static void write_frame(const char* folder, int frame, uint32_t cube) {
  char path[4096];
  EfsiVdbDef vdb;
  require(efsi_vdb_def_init(&vdb, sizeof(vdb)), "efsi_vdb_def_init");
  snprintf(path, sizeof path, "%s/smoke.%04d.vdb", folder, frame);
  require(efsi_vdb_write(sim, path, &vdb, NULL), "efsi_vdb_write");

  float points[24];
  require(efsi_solid_get_surface(sim, cube, points, NULL, 8), "efsi_solid_get_surface");
  snprintf(path, sizeof path, "%s/cube.%04d.obj", folder, frame);
  FILE* file = fopen(path, "w");
  if (!file) {
    perror(path);
    exit(1);
  }
  for (int i = 0; i < 8; ++i)
    fprintf(file, "v %g %g %g\n", (double)points[3 * i], (double)points[3 * i + 1], (double)points[3 * i + 2]);
  for (int f = 0; f < 6; ++f)
    fprintf(file, "f %d %d %d %d\n", kIndices[4 * f] + 1, kIndices[4 * f + 1] + 1, kIndices[4 * f + 2] + 1,
            kIndices[4 * f + 3] + 1);
  fclose(file);
}

int main(int argc, char** argv) {
  const char* folder = argc > 1 ? argv[1] : NULL;
  const int frames = argc > 2 ? atoi(argv[2]) : 4;

  /* A box of 0.6 m with its lower corner at the origin, 3 cm voxels, filled with air. */
  EfsiSimulationDef box;
  EfsiError error = {EFSI_OK, ""};
  require(efsi_simulation_def_init(&box, sizeof(box)), "efsi_simulation_def_init");
  box.domain_size.x = box.domain_size.y = box.domain_size.z = 0.6;
  box.voxel_size = 0.03;
  box.gravity.y = -9.8;
  box.max_time_step = 1.0 / 240.0;
  if (efsi_simulation_create(&box, &sim, &error) != EFSI_OK) {
    fprintf(stderr, "efsi_simulation_create: %s\n", error.message);
    return 1;
  }

  EfsiSolidDef cube;
  uint32_t cube_id = 0;
  require(efsi_solid_def_init(&cube, sizeof(cube)), "efsi_solid_def_init");
  cube.mesh.points = kPoints;
  cube.mesh.point_count = 8;
  cube.mesh.face_vertex_counts = kCounts;
  cube.mesh.face_count = 6;
  cube.mesh.face_vertex_indices = kIndices;
  cube.mesh.index_count = 24;
  cube.youngs_modulus = 2e4;
  require(efsi_solid_add(sim, &cube, &cube_id), "efsi_solid_add");

  /* Smoke in the lowest 6 cm: the unit box, scaled and moved. */
  EfsiEmitterDef carpet;
  uint32_t carpet_id = 0;
  require(efsi_emitter_def_init(&carpet, sizeof(carpet)), "efsi_emitter_def_init");
  const double transform[16] = {0.6, 0, 0, 0.3, 0, 0.06, 0, 0.03, 0, 0, 0.6, 0.3, 0, 0, 0, 1};
  for (int i = 0; i < 16; ++i) carpet.transform[i] = transform[i];
  carpet.density = 1.0;
  require(efsi_emitter_add(sim, &carpet, &carpet_id), "efsi_emitter_add");

  for (int frame = 1; frame <= frames; ++frame) {
    EfsiStepInfo step;
    EfsiSolidDiagnostics state;
    require(efsi_simulation_advance(sim, 1.0 / 24.0, &step, sizeof(step), NULL, NULL), "efsi_simulation_advance");
    require(efsi_solid_get_diagnostics(sim, cube_id, &state, sizeof(state)), "efsi_solid_get_diagnostics");
    printf("frame %d: %d steps, cube at height %.4f m, volume %.5f m^3\n", frame, (int)step.steps, state.center.y,
           state.volume_mesh);
    if (folder) write_frame(folder, frame, cube_id);

    /* Until it touches the floor the cube falls freely: the air has a thousandth of its density. */
    const double time = frame / 24.0, expected = 0.4 - 0.5 * 9.8 * time * time;
    if (expected > 0.2 && fabs(state.center.y - expected) > 0.01) {
      fprintf(stderr, "the cube should be at %.4f m\n", expected);
      return 1;
    }
  }
  efsi_simulation_destroy(sim);
  return 0;
}
