/** @file
 * eulerfsi: body forces on fluid and solids in a region. */
#ifndef EULERFSI_FORCE_H
#define EULERFSI_FORCE_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** Kinds of forces. */
typedef enum EfsiForceKind {
  EFSI_FORCE_CONSTANT = 0, /**< the same acceleration everywhere */
  EFSI_FORCE_RADIAL = 1,   /**< directed away from the centre of the region */
  EFSI_FORCE_WIND = 2,     /**< drag towards a wind velocity with noise */
} EfsiForceKind;

/** What a force acts on. */
typedef enum EfsiActsOn {
  EFSI_ACTS_ON_BOTH = 0,   /**< fluid and solids */
  EFSI_ACTS_ON_FLUID = 1,  /**< the fluid */
  EFSI_ACTS_ON_SOLIDS = 2, /**< the solids */
} EfsiActsOn;

/** A body force in a region, the image of the box [-1/2,1/2]^3 or of the ball of radius 1/2 under `transform`
 * (row-major 4x4, applied to column vectors (x,y,z,1), metres). Fields and limits: libeulerfsi/parameters.toml, scope
 * "force". */
typedef struct EfsiForceDef {
  uint32_t struct_size;       /**< set by the function that fills the definition */
  uint32_t magic;             /**< the same */
  int32_t shape;              /**< EFSI_REGION_BOX, EFSI_REGION_SPHERE */
  int32_t kind;               /**< EfsiForceKind */
  int32_t acts_on;            /**< EfsiActsOn */
  int32_t padding;            /**< unused */
  double transform[16];       /**< of the region */
  EfsiVec3 acceleration;      /**< of a constant force [m/s^2] */
  double radial_acceleration; /**< of a radial force; negative: towards the centre [m/s^2] */
  EfsiVec3 wind_velocity;     /**< of a wind [m/s] */
  double wind_drag;           /**< rate at which velocities relax to the wind's [1/s] */
  double noise_speed;         /**< root mean square of the noise [m/s] */
  double noise_size;          /**< size of the noise's eddies [m] */
  double noise_frequency;     /**< rate at which the eddies change [1/s] */
  double start_time;          /**< [s] */
  double end_time;            /**< [s] */
} EfsiForceDef;

/** Fills a definition with its header, the defaults and the identity as transform.
 * @param size sizeof *def */
EFSI_API EfsiStatus efsi_force_def_init(EfsiForceDef* def, size_t size);

/** Adds a force; allowed before the first step only.
 * @param def the force, copied
 * @param[out] id 1-based; may be NULL */
EFSI_API EfsiStatus efsi_force_add(struct EfsiSim* sim, const EfsiForceDef* def, uint32_t* id);

#ifdef __cplusplus
}
#endif
#endif
