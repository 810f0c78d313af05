/** @file
 * eulerfsi: OpenVDB output. */
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
  double transform[16];     /**< row-major 4x4, column vectors: simulation space [m] to world space */
  double density_threshold; /**< cells with at most this smoke density are inactive */
  int32_t half_float;       /**< 1: values are stored as 16-bit floats */
  int32_t write_velocity;   /**< 1: writes `vel` in active cells, in world units per second and world axes */
} EfsiVdbDef;

/** Fills a definition with its header, the defaults and the identity as transform. size: sizeof *def. */
EFSI_API EfsiStatus efsi_vdb_def_init(EfsiVdbDef* def, size_t size);
/** Writes one .vdb file with the cell-centred grids `density`, `vel` and, where the scene uses it, `temperature`. The
 * file is written under a temporary name in the same folder and then renamed. path: UTF-8. content_hash: out, 64-bit
 * hash of grid names, transforms, active voxels and values; may be NULL. The UUID in the file's header is derived from
 * that hash, so that the same state and definition give the same bytes. EFSI_ERROR_IO where the file cannot be written.
 */
EFSI_API EfsiStatus efsi_vdb_write(struct EfsiSim* sim, const char* path, const EfsiVdbDef* def,
                                   uint64_t* content_hash);

#ifdef __cplusplus
}
#endif
#endif
