/* eulerfsi: the simulation: creation, stepping, cancel, checkpoint, hash. */
#ifndef EULERFSI_SIMULATION_H
#define EULERFSI_SIMULATION_H

#include "eulerfsi/base.h"
#include "eulerfsi/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One simulation; one thread at a time, many simulations per process. */
typedef struct EfsiSim EfsiSim;

#define EFSI_PRESET_PRODUCTION 0 /* default */
#define EFSI_PRESET_PAPER2016 1  /* the paper's scheme */

#define EFSI_WALL_SLIP 0     /* normal velocity zero (default) */
#define EFSI_WALL_NO_SLIP 1  /* velocity zero */
#define EFSI_WALL_OPEN 2     /* the pressure of the fluid at rest, flow in and out */
#define EFSI_WALL_PERIODIC 3 /* both faces of an axis must be periodic */

/* Scene-wide settings; fields and limits as in libeulerfsi/parameters.toml, scope "domain". */
typedef struct EfsiSimulationDef {
  uint32_t struct_size;
  uint32_t magic;
  EfsiVec3 domain_min;          /* lower corner of the box [m] */
  EfsiVec3 domain_size;         /* edge lengths [m]; rounded up to whole voxels */
  double voxel_size;            /* h [m] */
  EfsiVec3 gravity;             /* g [m/s^2] */
  int32_t preset;               /* EFSI_PRESET_* */
  int32_t wall[6];              /* EFSI_WALL_* of faces -x +x -y +y -z +z */
  int32_t ambient_fluid;        /* 1: fluid fills the box outside the solids; 0: vacuum */
  double fluid_density;         /* [kg/m^3] */
  double fluid_viscosity;       /* dynamic, mu [Pa s]; 0: none, the fluid slips along solids */
  EfsiVec3 wall_velocity[6];    /* of the faces as in wall [m/s]: along itself a no-slip wall drags the fluid; across
                                   itself a wall lets fluid through */
  double vorticity_confinement; /* epsilon of Fedkiw et al. 2001, dimensionless */
  double smoke_buoyancy;        /* downward acceleration per unit of smoke density [m/s^2] */
  double temperature_buoyancy;  /* upward acceleration per kelvin [m/s^2/K] */
  double cfl_solid;             /* cells per step that a solid may move */
  double cfl_fluid;             /* cells per step that the fluid may move */
  double max_time_step;         /* [s]; 0: the frame */
  double velocity_tolerance;    /* of Eq. 8; 0: from the preset */
  double pressure_tolerance;    /* of Eq. 12; 0: from the preset */
  int32_t threads;              /* 0: all processors that this process may use */
  int32_t energy_ledger;        /* 1: measures what each stage of a step does to the energy; changes no result */
  uint64_t memory_limit;        /* bytes; 0: no check */
  EfsiLogCallback log;
  void* log_user;
  int32_t volume_source; /* 1: solids are pulled back to their volume at rest; not with preset paper2016 */
  int32_t reserved0;
  uint64_t reserved[2];
} EfsiSimulationDef;

/* Called between steps on the caller's thread. fraction: part of the requested interval done, 0..1.
 * Return non-zero to cancel. */
typedef int32_t (*EfsiProgressCallback)(void* user, double fraction, const EfsiStepInfo* last_step);

EFSI_API EfsiStatus efsi_simulation_def_init(EfsiSimulationDef* def);
/* Bytes that a simulation with this box will need, and the smallest voxel size that fits `memory_limit`
 * (0 when no limit is set). solid_volume: sum of the solids' bounding-box volumes [m^3]. Without ambient fluid that of
 * solids close together: what lies between solids that are apart takes memory, too. */
EFSI_API EfsiStatus efsi_simulation_estimate_memory(const EfsiSimulationDef* def, double solid_volume, uint64_t* bytes,
                                                    double* fitting_voxel_size, EfsiError* error);
/* Creates a simulation at time 0. error may be NULL. */
EFSI_API EfsiStatus efsi_simulation_create(const EfsiSimulationDef* def, EfsiSim** sim, EfsiError* error);
/* NULL is allowed. */
EFSI_API void efsi_simulation_destroy(EfsiSim* sim);
/* Message of the last failed call on this simulation; "" when none. Valid until the next call. */
EFSI_API const char* efsi_simulation_last_error(const EfsiSim* sim);

/* One step (Algorithm 1) of at most max_dt seconds; info may be NULL. */
EFSI_API EfsiStatus efsi_simulation_step(EfsiSim* sim, double max_dt, EfsiStepInfo* info);
/* Advances by `duration` seconds in equal sub-steps that land on the end exactly.
 * info: out, of the last step, counters summed over the steps; may be NULL. progress may be NULL. */
EFSI_API EfsiStatus efsi_simulation_advance(EfsiSim* sim, double duration, EfsiStepInfo* info,
                                            EfsiProgressCallback progress, void* user);
EFSI_API EfsiStatus efsi_simulation_get_time(const EfsiSim* sim, double* time, uint64_t* steps);

/* 64-bit hash of the state's values (independent of thread count). */
EFSI_API EfsiStatus efsi_simulation_get_hash(EfsiSim* sim, uint64_t* hash);
/* Writes the state under a temporary name and renames it. path: UTF-8. */
EFSI_API EfsiStatus efsi_simulation_save_checkpoint(EfsiSim* sim, const char* path);
/* Restores into a simulation that was set up with the same definitions, before its first step or later. */
EFSI_API EfsiStatus efsi_simulation_restore_checkpoint(EfsiSim* sim, const char* path);
/* Before the first step: the solids get the shape, velocity and plastic strain that they have in a checkpoint of a
 * simulation with the same box, voxel size and solids, in the same order. Fluid, forces, walls, emitters, materials,
 * pins and colliders may differ; time stays 0, and the fluid as it is. */
EFSI_API EfsiStatus efsi_simulation_restore_solids(EfsiSim* sim, const char* path);

/* Times, tiles and bytes per stage so far, and starting them anew; what the fluid holds now. */
EFSI_API EfsiStatus efsi_simulation_get_profile(const EfsiSim* sim, EfsiProfile* profile);
EFSI_API EfsiStatus efsi_simulation_reset_profile(EfsiSim* sim);
EFSI_API EfsiStatus efsi_simulation_get_repairs(const EfsiSim* sim, EfsiRepairs* out);
/* Solids that have pushed each other in the last call of efsi_simulation_step or efsi_simulation_advance, so far; in
 * the order of their ids. count: out, how many pairs there are. pairs: out, the first `capacity` of them; may be NULL
 * where that is 0. */
EFSI_API EfsiStatus efsi_simulation_get_contacts(const EfsiSim* sim, EfsiContactPair* pairs, uint64_t capacity,
                                                 uint64_t* count);
/* EFSI_ERROR_ARGUMENT where EfsiSimulationDef.energy_ledger is 0; zeros before the first step. */
EFSI_API EfsiStatus efsi_simulation_get_energy_ledger(const EfsiSim* sim, EfsiEnergyLedger* out);
EFSI_API EfsiStatus efsi_simulation_get_fluid_diagnostics(EfsiSim* sim, EfsiFluidDiagnostics* out);

#ifdef __cplusplus
}
#endif
#endif
