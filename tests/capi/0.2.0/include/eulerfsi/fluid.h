/** @file
 * eulerfsi: smoke emitters and jets; the state of the fluid. */
#ifndef EULERFSI_FLUID_H
#define EULERFSI_FLUID_H

#include "eulerfsi/base.h"
#include "eulerfsi/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** When an emitter acts. */
typedef enum EfsiEmitterMode {
  EFSI_EMITTER_INITIAL = 0,    /**< fills its region once, before the first step */
  EFSI_EMITTER_CONTINUOUS = 1, /**< imposes its values from start_time to end_time */
} EfsiEmitterMode;

/** A region that emits smoke into the fluid and, with has_velocity = 1, prescribes the fluid's velocity. A continuous
 * emitter with a velocity is a jet: in a box with an open face it is a source of the volume that leaves its region.
 * Emitters do not act on solids. The region is the image of the box [-1/2,1/2]^3 or of the ball of radius 1/2 under
 * `transform` (row-major 4x4, applied to column vectors (x,y,z,1), metres). */
typedef struct EfsiEmitterDef {
  uint32_t struct_size; /**< set by the function that fills the definition */
  uint32_t magic;       /**< the same */
  int32_t shape;        /**< EfsiRegionShape */
  int32_t mode;         /**< EfsiEmitterMode */
  double transform[16]; /**< of the region */
  double density;       /**< smoke density inside, dimensionless, >= 0 */
  double temperature;   /**< difference from ambient inside [K] */
  EfsiVec3 velocity;    /**< [m/s], used when has_velocity is 1 */
  double start_time;    /**< [s] */
  double end_time;      /**< [s] */
  int32_t has_velocity; /**< 1: `velocity` is prescribed */
  int32_t padding;      /**< unused */
} EfsiEmitterDef;

/** Fills a definition with its header, the defaults and the identity as transform.
 * @param size sizeof *def */
EFSI_API EfsiStatus efsi_emitter_def_init(EfsiEmitterDef* def, size_t size);

/** Adds an emitter; allowed before the first step only.
 * @param def the emitter, copied
 * @param[out] id 1-based; may be NULL
 * @retval EFSI_ERROR_ARGUMENT the region contains no cell centre */
EFSI_API EfsiStatus efsi_emitter_add(struct EfsiSim* sim, const EfsiEmitterDef* def, uint32_t* id);

/** Adds an emitter whose region is a closed mesh; allowed before the first step only.
 * @param def shape and transform are ignored
 * @param volume made for the simulation's voxel size
 * @param[out] id 1-based; may be NULL */
EFSI_API EfsiStatus efsi_emitter_add_volume(struct EfsiSim* sim, const EfsiEmitterDef* def, const EfsiSurface* volume,
                                            uint32_t* id);

/** Values of a continuous emitter at one time. Values are interpolated linearly between keys, jump between two keys of
 * the same time, and are constant before the first key and after the last. */
typedef struct EfsiEmitterKey {
  double time;        /**< [s] */
  double density;     /**< as in EfsiEmitterDef */
  double temperature; /**< [K] */
  EfsiVec3 velocity;  /**< [m/s] */
  int32_t on;         /**< 0: off until the next key */
  int32_t padding;    /**< unused */
} EfsiEmitterKey;

/** Sets the keys of an emitter, which replace the values of its definition; start_time and end_time still apply.
 * Allowed before the first step only.
 * @param id of the emitter
 * @param keys in the order of their times
 * @param key_size sizeof *keys
 * @param count at least 1
 * @retval EFSI_ERROR_ARGUMENT keys that are out of order */
EFSI_API EfsiStatus efsi_emitter_set_keys(struct EfsiSim* sim, uint32_t id, const EfsiEmitterKey* keys, size_t key_size,
                                          uint64_t count);

/** Returns the volume flux of an emitter into the box in the last step; 0 before the first step, and where no face of
 * the box is open.
 * @param id of the emitter
 * @param[out] flux [m^3/s] */
EFSI_API EfsiStatus efsi_emitter_get_flux(const struct EfsiSim* sim, uint32_t id, double* flux);

/** The current state of the fluid. */
typedef struct EfsiFluidDiagnostics {
  double kinetic_energy; /**< [J] */
  EfsiVec3 momentum;     /**< [kg m/s] */
  double max_speed;      /**< [m/s] */
  double smoke;          /**< integral of the smoke density [m^3] */
  double max_divergence; /**< [1/s] */
  double carried_energy; /**< what the half of the pressure that the transport carries has added to the kinetic energy
                              ahead of time; the energy ledger counts it as the fluid's (preset production) [J] */
} EfsiFluidDiagnostics;

/** Returns integrals and extrema of the fluid.
 * @param[out] out the current state
 * @param size sizeof *out */
EFSI_API EfsiStatus efsi_simulation_get_fluid_diagnostics(struct EfsiSim* sim, EfsiFluidDiagnostics* out, size_t size);

#ifdef __cplusplus
}
#endif
#endif
