/** @file
 * eulerfsi: OpenVDB output. */
#ifndef EULERFSI_IO_H
#define EULERFSI_IO_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** A .vdb file. */
typedef struct EfsiVdbDef {
  uint32_t struct_size;     /**< set by the function that fills the definition */
  uint32_t magic;           /**< the same */
  double transform[16];     /**< row-major 4x4, column vectors: simulation space [m] to world space */
  double density_threshold; /**< cells with at most this smoke density are inactive */
  int32_t half_float;       /**< 1: values are stored as 16-bit floats */
  int32_t write_velocity;   /**< 1: writes `vel` in active cells, in world units per second and world axes */
} EfsiVdbDef;

/** Fills a definition with its header, the defaults and the identity as transform.
 * @param size sizeof *def */
EFSI_API EfsiStatus efsi_vdb_def_init(EfsiVdbDef* def, size_t size);

/** Writes one .vdb file with the cell-centred grids `density`, `vel` and, where the scene uses it, `temperature`. The
 * file is written under a temporary name in the same folder and then renamed. The UUID in its header is derived from
 * the content hash, so that the same state and definition give the same bytes.
 * @param path UTF-8
 * @param def where and how
 * @param[out] content_hash 64-bit hash of grid names, transforms, active voxels and values; may be NULL
 * @retval EFSI_ERROR_IO the file cannot be written */
EFSI_API EfsiStatus efsi_vdb_write(struct EfsiSim* sim, const char* path, const EfsiVdbDef* def,
                                   uint64_t* content_hash);

#ifdef __cplusplus
}
#endif
#endif
