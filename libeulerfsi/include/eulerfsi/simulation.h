/** @file
 * eulerfsi: the simulation: creation, steps, cancellation, checkpoints, state hash, records. */
#ifndef EULERFSI_SIMULATION_H
#define EULERFSI_SIMULATION_H

#include "eulerfsi/base.h"
#include "eulerfsi/record.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A simulation. A process may hold any number of them; calls on one simulation must not overlap in time. */
typedef struct EfsiSim EfsiSim;

/** Numerical schemes. */
typedef enum EfsiPreset {
  EFSI_PRESET_PRODUCTION = 0, /**< default */
  EFSI_PRESET_PAPER2016 = 1,  /**< the paper's scheme */
  EFSI_PRESET_FAST = 2,       /**< production in the longest steps that geometry allows: damped, for layout */
} EfsiPreset;

/** Conditions at a face of the box. */
typedef enum EfsiWall {
  EFSI_WALL_SLIP = 0,     /**< normal velocity zero (default) */
  EFSI_WALL_NO_SLIP = 1,  /**< velocity zero */
  EFSI_WALL_OPEN = 2,     /**< hydrostatic pressure, flow in and out */
  EFSI_WALL_PERIODIC = 3, /**< both faces of an axis must be periodic */
} EfsiWall;

/** Settings of the whole scene. Fields and limits: libeulerfsi/parameters.toml, scope "domain". */
typedef struct EfsiSimulationDef {
  uint32_t struct_size;      /**< set by the function that fills the definition */
  uint32_t magic;            /**< the same */
  EfsiVec3 domain_min;       /**< lower corner of the box [m] */
  EfsiVec3 domain_size;      /**< edge lengths [m]; rounded up to whole voxels */
  double voxel_size;         /**< h [m] */
  EfsiVec3 gravity;          /**< g [m/s^2] */
  int32_t preset;            /**< EfsiPreset */
  int32_t wall[6];           /**< EfsiWall of the faces -x +x -y +y -z +z */
  int32_t ambient_fluid;     /**< 1: fluid fills the box outside the solids; 0: vacuum */
  double fluid_density;      /**< [kg/m^3] */
  double fluid_viscosity;    /**< dynamic [Pa s]; 0: inviscid, the fluid slips along solids */
  EfsiVec3 wall_velocity[6]; /**< of the faces as in wall [m/s]: the tangential part drags the fluid at a no-slip wall,
                                the normal part lets fluid through a wall */
  double vorticity_confinement; /**< epsilon of Fedkiw et al. 2001, dimensionless */
  double smoke_buoyancy;        /**< downward acceleration per unit of smoke density [m/s^2] */
  double temperature_buoyancy;  /**< upward acceleration per kelvin [m/s^2/K] */
  double cfl_solid;             /**< limit of the displacement of solids per step [cells] */
  double cfl_fluid;             /**< limit of the displacement of the fluid per step [cells] */
  double max_time_step;         /**< upper limit of a step [s]; 0: the duration of the call */
  double velocity_tolerance;    /**< relative, of Eq. 8; 0: from the preset */
  double pressure_tolerance;    /**< relative, of Eq. 12; 0: from the preset */
  int32_t threads;              /**< 0: all processors that this process may use */
  int32_t energy_ledger;        /**< 1: records the energy change of each stage; no effect on results */
  uint64_t memory_limit;        /**< [bytes]; 0: no check */
  EfsiLogCallback log;          /**< may be NULL */
  void* log_user;               /**< passed to `log` */
  int32_t volume_source;        /**< 1: a volume source restores the rest volume of solids; not in preset paper2016 */
  int32_t padding;              /**< unused */
  double step_tolerance;        /**< part of its energy that the steps of a solid in contact may take while an elastic
                                   wave passes it, at least 0.001; 0: from the preset */
} EfsiSimulationDef;

/** Reports progress. Called after each step on the caller's thread. fraction: completed part of the requested duration,
 * 0 to 1. Returns non-zero to cancel. */
typedef int32_t (*EfsiProgressCallback)(void* user, double fraction, const EfsiStepInfo* last_step);

/** Fills a definition with its header and the defaults: a box of 1 m, no gravity.
 * @param size sizeof *def */
EFSI_API EfsiStatus efsi_simulation_def_init(EfsiSimulationDef* def, size_t size);

/** Estimates the memory of a simulation. Without ambient fluid the space between distant solids takes memory, too, and
 * is not included.
 * @param solid_volume sum of the bounding-box volumes of the solids [m^3]
 * @param[out] bytes may be NULL
 * @param[out] fitting_voxel_size the smallest voxel size within def->memory_limit [m], 0 without a limit; may be NULL
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_MEMORY no voxel size is within the limit */
EFSI_API EfsiStatus efsi_simulation_estimate_memory(const EfsiSimulationDef* def, double solid_volume, uint64_t* bytes,
                                                    double* fitting_voxel_size, EfsiError* error);

/** Returns the axis along which a domain is one cell thick between slip walls, a slab: a scene in 2-D.
 * @param[out] axis 0 to 2; -1 where there is none
 * @param[out] error may be NULL */
EFSI_API EfsiStatus efsi_simulation_def_get_slab_axis(const EfsiSimulationDef* def, int32_t* axis, EfsiError* error);

/** Limits of the time step that a simulation keeps by itself. */
typedef struct EfsiStepLimits {
  double contact_reach; /**< distance of a solid from a wall below which the next two apply [cells] */
  double contact_cfl;   /**< displacement of a solid near a wall per step [cells] */
  double contact_pace; /**< distance that shear waves travel per step in a solid that was struck [cells]; 0: no limit */
  double flight_cfl;   /**< displacement of a single solid away from walls per step [cells] */
  double contact_share; /**< part of the solid, the cubic root of its volume, that these waves travel where that is
                           more */
} EfsiStepLimits;

/** Returns the limits of the time step.
 * @param lightest_density of the solids [kg/m^3]
 * @param[out] limits the limits
 * @param size sizeof *limits
 * @param[out] error may be NULL */
EFSI_API EfsiStatus efsi_simulation_def_get_step_limits(const EfsiSimulationDef* def, double lightest_density,
                                                        EfsiStepLimits* limits, size_t size, EfsiError* error);

/** Creates a simulation at time 0.
 * @param[out] sim to be destroyed with efsi_simulation_destroy
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_MEMORY the box exceeds def->memory_limit */
EFSI_API EfsiStatus efsi_simulation_create(const EfsiSimulationDef* def, EfsiSim** sim, EfsiError* error);

/** Destroys a simulation; NULL is allowed. */
EFSI_API void efsi_simulation_destroy(EfsiSim* sim);

/** Returns the message of the last failed call on a simulation, "" when there is none. Valid until the next call. */
EFSI_API const char* efsi_simulation_last_error(const EfsiSim* sim);

/** Makes one step (Algorithm 1).
 * @param max_dt upper limit of its size [s]
 * @param[out] info may be NULL
 * @param size sizeof *info
 * @retval EFSI_ERROR_DIVERGED as in efsi_simulation_advance */
EFSI_API EfsiStatus efsi_simulation_step(EfsiSim* sim, double max_dt, EfsiStepInfo* info, size_t size);

/** Advances in equal steps that end exactly at the end of a duration.
 * @param duration [s]
 * @param[out] info values of the last step and counters summed over the steps, also when the call fails; may be NULL
 * @param size sizeof *info
 * @param progress may be NULL
 * @param user passed to `progress`
 * @retval EFSI_ERROR_DIVERGED a step failed at its smallest size, or a solid lost its shape
 * @retval EFSI_ERROR_CANCELLED `progress` cancelled */
EFSI_API EfsiStatus efsi_simulation_advance(EfsiSim* sim, double duration, EfsiStepInfo* info, size_t size,
                                            EfsiProgressCallback progress, void* user);

/** Returns the time and the number of steps so far.
 * @param[out] time [s]; may be NULL
 * @param[out] steps may be NULL */
EFSI_API EfsiStatus efsi_simulation_get_time(const EfsiSim* sim, double* time, uint64_t* steps);

/** Returns a hash of the state, which does not depend on the number of threads.
 * @param[out] hash 64 bits */
EFSI_API EfsiStatus efsi_simulation_get_hash(EfsiSim* sim, uint64_t* hash);

/** Writes the state to a file, under a temporary name that is then renamed.
 * @param path UTF-8
 * @retval EFSI_ERROR_IO the file cannot be written */
EFSI_API EfsiStatus efsi_simulation_save_checkpoint(EfsiSim* sim, const char* path);

/** Restores the state from a checkpoint of a simulation with the same definitions; allowed at any time.
 * @param path UTF-8
 * @retval EFSI_ERROR_IO the file cannot be read
 * @retval EFSI_ERROR_CHECKPOINT a checkpoint of another scene or version */
EFSI_API EfsiStatus efsi_simulation_restore_checkpoint(EfsiSim* sim, const char* path);

/** Restores the state from a checkpoint of a simulation with other parameters, to continue with these; allowed at any
 * time. Box, voxel size, periodic axes, and solids and colliders with their meshes must be the same in the same order;
 * parameters, walls, materials, emitters, forces, pins and later motions may differ. With the same definitions it does
 * what efsi_simulation_restore_checkpoint does.
 * @param path UTF-8
 * @retval EFSI_ERROR_IO the file cannot be read
 * @retval EFSI_ERROR_CHECKPOINT a checkpoint of another box, other bodies or another version */
EFSI_API EfsiStatus efsi_simulation_restore_state(EfsiSim* sim, const char* path);

/** Restores shape, velocity and plastic strain of the solids from a checkpoint of a simulation with the same box, voxel
 * size and solids in the same order; allowed before the first step only. Fluid, forces, walls, emitters, materials,
 * pins and colliders may differ. Time stays 0 and the fluid is not changed.
 * @param path UTF-8
 * @retval EFSI_ERROR_IO the file cannot be read
 * @retval EFSI_ERROR_CHECKPOINT a checkpoint of other solids or another version */
EFSI_API EfsiStatus efsi_simulation_restore_solids(EfsiSim* sim, const char* path);

#ifdef __cplusplus
}
#endif
#endif
