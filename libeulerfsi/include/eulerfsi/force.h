/* eulerfsi: forces that act in a region on fluid and solids. */
#ifndef EULERFSI_FORCE_H
#define EULERFSI_FORCE_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

#define EFSI_FORCE_CONSTANT 0 /* the same acceleration everywhere */
#define EFSI_FORCE_RADIAL 1   /* away from the middle of the region */
#define EFSI_FORCE_WIND 2     /* takes matter along with the wind and its noise */

#define EFSI_ACTS_ON_BOTH 0
#define EFSI_ACTS_ON_FLUID 1
#define EFSI_ACTS_ON_SOLIDS 2

/* A force in a region: the image of the box [-1/2,1/2]^3 or of the ball of radius 1/2 under `transform` (row-major 4x4,
 * applied to column vectors (x,y,z,1), metres). Fields and limits as in libeulerfsi/parameters.toml, scope "force". */
typedef struct EfsiForceDef {
  uint32_t struct_size;
  uint32_t magic;
  int32_t shape;   /* EFSI_EMITTER_BOX, EFSI_EMITTER_SPHERE */
  int32_t kind;    /* EFSI_FORCE_* */
  int32_t acts_on; /* EFSI_ACTS_ON_* */
  int32_t reserved0;
  double transform[16];
  EfsiVec3 acceleration;      /* constant [m/s^2] */
  double radial_acceleration; /* radial; negative: towards the middle [m/s^2] */
  EfsiVec3 wind_velocity;     /* [m/s] */
  double wind_drag;           /* rate at which the wind takes matter along [1/s] */
  double noise_speed;         /* root of the mean square of the noise [m/s] */
  double noise_size;          /* of its eddies [m] */
  double noise_frequency;     /* at which they change [1/s] */
  double start_time;          /* [s] */
  double end_time;            /* [s] */
  uint64_t reserved[2];
} EfsiForceDef;

EFSI_API EfsiStatus efsi_force_def_init(EfsiForceDef* def);
/* Adds a force before the first step. id: out, 1-based. */
EFSI_API EfsiStatus efsi_force_add(struct EfsiSim* sim, const EfsiForceDef* def, uint32_t* id);

#ifdef __cplusplus
}
#endif
#endif
