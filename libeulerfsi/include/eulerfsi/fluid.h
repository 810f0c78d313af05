/* eulerfsi: the ambient fluid, smoke emitters. */
#ifndef EULERFSI_FLUID_H
#define EULERFSI_FLUID_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

#define EFSI_EMITTER_BOX 0
#define EFSI_EMITTER_SPHERE 1

#define EFSI_EMIT_INITIAL 0    /* fills its region once, at the first step */
#define EFSI_EMIT_CONTINUOUS 1 /* holds its values from start_time to end_time */

/* A region that carries smoke into the fluid. The region is the image of the box [-1/2,1/2]^3 or of the
 * ball of radius 1/2 under `transform` (row-major 4x4, applied to column vectors (x,y,z,1), metres). */
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

#ifdef __cplusplus
}
#endif
#endif
