/* eulerfsi: OpenVDB output. */
#ifndef EULERFSI_IO_H
#define EULERFSI_IO_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

typedef struct EfsiVdbDef {
  uint32_t struct_size;
  uint32_t magic;
  double transform[16];     /* row-major 4x4, simulation space [m] to world space of the stage, column vectors */
  double density_threshold; /* cells with less smoke are background */
  int32_t half_float;       /* 1: store 16-bit floats */
  int32_t write_velocity;   /* 1: grid `vel` where smoke is, in world units per second and world axes */
  uint32_t reserved[4];
} EfsiVdbDef;

EFSI_API EfsiStatus efsi_vdb_def_init(EfsiVdbDef* def);
/* Writes one .vdb with the grids `density`, `vel` and, where the scene uses it, `temperature`, cell-centred, under a
 * temporary name in the same folder and renames it. content_hash: out, 64-bit hash of grid names, transforms, active
 * voxels and values; may be NULL. The UUID in the file's header is made from that hash: same state and def, same bytes.
 */
EFSI_API EfsiStatus efsi_vdb_write(struct EfsiSim* sim, const char* path, const EfsiVdbDef* def,
                                   uint64_t* content_hash);

#ifdef __cplusplus
}
#endif
#endif
