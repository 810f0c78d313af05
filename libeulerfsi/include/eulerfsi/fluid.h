/* eulerfsi: the ambient fluid, smoke emitters. */
#ifndef EULERFSI_FLUID_H
#define EULERFSI_FLUID_H

#include "eulerfsi/base.h"
#include "eulerfsi/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

#define EFSI_EMITTER_BOX 0
#define EFSI_EMITTER_SPHERE 1

#define EFSI_EMIT_INITIAL 0    /* fills its region once, at the first step */
#define EFSI_EMIT_CONTINUOUS 1 /* holds its values from start_time to end_time */

/* A region that carries smoke into the fluid, and blows it where has_velocity is 1. A continuous one with a velocity is
 * a jet: in a box with an open face it brings the volume that flows out of it. Solids are left as they are. The region
 * is the image of the box [-1/2,1/2]^3 or of the ball of radius 1/2 under `transform` (row-major 4x4, applied to column
 * vectors (x,y,z,1), metres). */
typedef struct EfsiEmitterDef {
  uint32_t struct_size;
  uint32_t magic;
  int32_t shape; /* EFSI_EMITTER_* */
  int32_t mode;  /* EFSI_EMIT_* */
  double transform[16];
  double density;     /* smoke density inside, dimensionless, >= 0 */
  double temperature; /* difference to ambient inside [K] */
  EfsiVec3 velocity;  /* [m/s], used when has_velocity is 1 */
  double start_time;  /* [s] */
  double end_time;    /* [s] */
  int32_t has_velocity;
  uint32_t reserved[3];
} EfsiEmitterDef;

EFSI_API EfsiStatus efsi_emitter_def_init(EfsiEmitterDef* def);
/* Adds an emitter before the first step. id: out, 1-based. */
EFSI_API EfsiStatus efsi_emitter_add(struct EfsiSim* sim, const EfsiEmitterDef* def, uint32_t* id);

/* The same with a closed mesh as its region, made for the simulation's voxel size; shape and transform do not count. */
EFSI_API EfsiStatus efsi_emitter_add_volume(struct EfsiSim* sim, const EfsiEmitterDef* def, const EfsiSurface* volume,
                                            uint32_t* id);

/* Values of a continuous emitter at a time. They are linear between two keys and jump between two of the same time;
 * before the first key and after the last they are those of that key. */
typedef struct EfsiEmitterKey {
  double time;        /* [s] */
  double density;     /* as in EfsiEmitterDef */
  double temperature; /* [K] */
  EfsiVec3 velocity;  /* [m/s] */
  int32_t on;         /* 0: off until the next key */
  uint32_t reserved;
} EfsiEmitterKey;
/* Keys in the order of their times, in the place of the definition's values; start_time and end_time still count.
 * Before the first step. */
EFSI_API EfsiStatus efsi_emitter_set_keys(struct EfsiSim* sim, uint32_t id, const EfsiEmitterKey* keys, uint64_t count);
/* Volume per time that an emitter has brought into the box in the last step [m^3/s]; 0 before, and where no face of the
 * box is open. */
EFSI_API EfsiStatus efsi_emitter_get_flux(const struct EfsiSim* sim, uint32_t id, double* flux);

#ifdef __cplusplus
}
#endif
#endif
