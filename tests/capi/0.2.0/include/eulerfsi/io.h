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
  EfsiVec3 region_min;      /**< lower corner of a box in simulation space [m]; cells with their centre outside it are
                                 inactive. All -infinity and infinity by default: the whole domain */
  EfsiVec3 region_max;      /**< upper corner */
} EfsiVdbDef;

/** A grid of a .vdb file. */
typedef struct EfsiVdbGrid {
  int32_t min[3];      /**< lowest voxel of the box of active voxels */
  uint32_t size[3];    /**< voxels along its edges; 0 0 0 where no voxel is active */
  uint32_t components; /**< values of a voxel: 1, or 3 of a vector */
  uint32_t padding;    /**< unused */
  double
      transform[16]; /**< row-major 4x4, column vectors: index space, with voxel centres at integers, to world space */
  uint64_t active_count; /**< number of active voxels */
} EfsiVdbGrid;

/** A .vdb file in memory. */
typedef struct EfsiVdb EfsiVdb;

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

/** Reads a .vdb file that efsi_vdb_write has written. Files carry a checksum, which is compared before anything else: a
 * damaged file, one that is cut short and one of another program or of a version before 0.2.0 are refused.
 * @param path UTF-8
 * @param[out] vdb to be destroyed with efsi_vdb_destroy; any number of threads may read from it
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_IO the file cannot be read */
EFSI_API EfsiStatus efsi_vdb_open(const char* path, EfsiVdb** vdb, EfsiError* error);

/** Describes a grid.
 * @param vdb the file
 * @param name UTF-8: `density`, `vel`, `temperature`
 * @param[out] grid what it holds
 * @param size sizeof *grid
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_ARGUMENT no such grid; the message names those of the file */
EFSI_API EfsiStatus efsi_vdb_get_grid(const EfsiVdb* vdb, const char* name, EfsiVdbGrid* grid, size_t size,
                                      EfsiError* error);

/** Reads a box of a grid in cells of coarsen^3 voxels. A cell has the mean of its voxels, inactive ones are 0; of a
 * vector the mean of the active ones.
 * @param vdb the file
 * @param name as above
 * @param min first voxel of the box, -2^30 to 2^30
 * @param cells numbers of cells along the axes, at least 1, in voxels at most 2^30
 * @param coarsen voxels along the edge of a cell, 1 to 1024
 * @param[out] values component c of cell (i, j, k) at c + components * (i + cells[0] * (j + cells[1] * k))
 * @param capacity number of floats that `values` has room for
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_ARGUMENT no such grid, or a box that is refused; nothing is written then */
EFSI_API EfsiStatus efsi_vdb_read(const EfsiVdb* vdb, const char* name, const int32_t min[3], const uint32_t cells[3],
                                  uint32_t coarsen, float* values, uint64_t capacity, EfsiError* error);

/** Destroys a file in memory; NULL is allowed. */
EFSI_API void efsi_vdb_destroy(EfsiVdb* vdb);

#ifdef __cplusplus
}
#endif
#endif
