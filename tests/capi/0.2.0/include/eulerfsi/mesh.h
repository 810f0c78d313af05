/** @file
 * eulerfsi: meshes, and surfaces prepared for a voxel size. */
#ifndef EULERFSI_MESH_H
#define EULERFSI_MESH_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A polygon mesh in the caller's memory; functions copy from it only where their comment says so. */
typedef struct EfsiMeshView {
  const float* points;                /**< x y z of point i at (char*)points + i*point_stride [m] */
  uint64_t point_count;               /**< number of points */
  uint64_t point_stride;              /**< bytes; 0 means 12 */
  const int32_t* face_vertex_counts;  /**< NULL: all faces are triangles */
  uint64_t face_count;                /**< number of faces */
  const int32_t* face_vertex_indices; /**< points of the faces, one face after the other */
  uint64_t index_count;               /**< number of indices */
} EfsiMeshView;

/** Properties of a mesh and of its repair. */
typedef struct EfsiMeshReport {
  double surface_volume;           /**< signed volume of the mesh as passed [m^3] */
  double solid_volume;             /**< volume of the closed solid [m^3] */
  EfsiVec3 extent_min, extent_max; /**< bounding box [m] */
  uint64_t triangles;              /**< number after the faces were split */
  uint64_t open_edges;             /**< edges with one face */
  uint64_t holes;                  /**< closed loops of open edges */
  double largest_hole;             /**< length of the longest such loop [m] */
  uint64_t nonmanifold_edges;      /**< edges with three or more faces */
  int32_t closed;                  /**< 1: no open edge */
  int32_t repaired;                /**< 1: the mesh was repaired; efsi_surface_get_repair_text describes it */
  double thinnest_feature;         /**< estimate of the smallest thickness of the solid [m] */
  double closing_radius;           /**< offset used to close the mesh [m]; 0: none */
  uint32_t pieces;                 /**< parts that no edge connects */
  uint32_t merged_points;          /**< coincident points that were merged */
  uint32_t reversed_triangles; /**< triangles whose orientation was reversed, alone or with their piece or the mesh */
  uint32_t inner_triangles;    /**< triangles inside the solid, removed in whole or in part */
  uint32_t separate_pieces;    /**< groups of pieces that do not touch; a solid should have one */
  uint32_t padding;            /**< unused */
} EfsiMeshReport;

/** A mesh that was read from a file. */
typedef struct EfsiMesh EfsiMesh;

/** Reads a mesh file. The file is read in this process: a damaged or hostile file can exhaust memory, crash the reader
 * or never finish. To read untrusted files, call this function in a child process with limits on memory and time.
 * @param path UTF-8; its suffix, in upper or lower case, is the format: obj, ply, stl, off, gltf, glb, fbx, dae, 3ds
 * @param[out] mesh to be destroyed with efsi_mesh_destroy
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_MESH another suffix, or content that does not match it
 * @retval EFSI_ERROR_IO the file cannot be read */
EFSI_API EfsiStatus efsi_mesh_load(const char* path, EfsiMesh** mesh, EfsiError* error);

/** Returns a view of a mesh.
 * @param[out] view valid until the mesh is destroyed */
EFSI_API EfsiStatus efsi_mesh_get_view(const EfsiMesh* mesh, EfsiMeshView* view);

/** An object of a mesh file: faces that follow each other. */
typedef struct EfsiMeshObject {
  const char* name;    /**< as in the file, often not unique; "" without one. Valid until the mesh is destroyed */
  uint64_t first_face; /**< its first face */
  uint64_t face_count; /**< number of its faces, at least 1 */
} EfsiMeshObject;

/** Returns the objects of a mesh, in the order of their faces; each face belongs to one. An object is a node of the
 * file that has faces; in an .obj file what a line `o` begins, or `g` where there is no `o`; in a file that knows no
 * objects the whole of it.
 * @param[out] objects the first `capacity` of them; may be NULL where capacity is 0
 * @param object_size sizeof *objects
 * @param capacity number of elements of `objects`
 * @param[out] count number of objects
 * @param[out] error may be NULL */
EFSI_API EfsiStatus efsi_mesh_get_objects(const EfsiMesh* mesh, EfsiMeshObject* objects, size_t object_size,
                                          uint64_t capacity, uint64_t* count, EfsiError* error);

/** Destroys a mesh; NULL is allowed. */
EFSI_API void efsi_mesh_destroy(EfsiMesh* mesh);

/** The solid bounded by a mesh, prepared for one voxel size. It is constant and may be used by any number of
 * simulations and threads. */
typedef struct EfsiSurface EfsiSurface;

/** Reports progress on the caller's thread. fraction: completed part, 0 to 1. Returns non-zero to cancel. */
typedef int32_t (*EfsiSurfaceProgress)(void* user, double fraction);

/** Creates the surface of a mesh.
 * @param mesh copied
 * @param voxel_size that of the simulations that will use the surface [m]
 * @param threads 0 for all processors that this process may use
 * @param progress may be NULL
 * @param user passed to `progress`
 * @param[out] surface to be destroyed with efsi_surface_destroy
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_MESH the mesh does not define a solid
 * @retval EFSI_ERROR_CANCELLED `progress` cancelled */
EFSI_API EfsiStatus efsi_surface_create(const EfsiMeshView* mesh, double voxel_size, int32_t threads,
                                        EfsiSurfaceProgress progress, void* user, EfsiSurface** surface,
                                        EfsiError* error);

/** Returns the properties and repairs of the mesh.
 * @param[out] report the properties
 * @param size sizeof *report */
EFSI_API EfsiStatus efsi_surface_get_report(const EfsiSurface* surface, EfsiMeshReport* report, size_t size);

/** Returns the description of the repairs that efsi_solid_add logs as a warning; "" where there is none. Valid as long
 * as the surface. */
EFSI_API const char* efsi_surface_get_repair_text(const EfsiSurface* surface);

/** Measures the overlap of two surfaces. efsi_solid_add refuses solids that overlap by more than half a voxel.
 * @param a one surface
 * @param b the other
 * @param[out] depth diameter of the largest ball inside both [m], 0 without overlap; may be NULL
 * @param[out] volume of their intersection [m^3]; may be NULL
 * @param[out] error may be NULL */
EFSI_API EfsiStatus efsi_surface_get_overlap(const EfsiSurface* a, const EfsiSurface* b, double* depth, double* volume,
                                             EfsiError* error);

/** Extrudes the section of a surface for a slab, a domain one cell thick between slip walls; the section halfway is
 * taken. In such a domain efsi_solid_add does this itself with any other surface.
 * @param axis 0 to 2, across the slab
 * @param low where the slab begins [m]
 * @param high where it ends [m]
 * @param[out] slab a surface of its own with the report of the slab, to be destroyed separately
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_MESH the mesh does not extend through the slab */
EFSI_API EfsiStatus efsi_surface_extrude_in_slab(const EfsiSurface* surface, int32_t axis, double low, double high,
                                                 EfsiSurface** slab, EfsiError* error);

/** Destroys a surface; NULL is allowed. Simulations that use it are not affected. */
EFSI_API void efsi_surface_destroy(EfsiSurface* surface);

/** Finds the nearest point of a set of triangles to each of some points.
 * @param corners 9*triangle_count doubles, x y z of the three corners of each triangle
 * @param triangle_count at least 1
 * @param points 3*point_count doubles in the same unit
 * @param point_count number of points
 * @param[out] triangles point_count indices; of equally near triangles the first
 * @param[out] weights 3*point_count doubles, of the corners, >= 0 and with sum 1
 * @param[out] error may be NULL
 * @retval EFSI_ERROR_ARGUMENT a value that is not finite */
EFSI_API EfsiStatus efsi_triangles_find_nearest(const double* corners, uint64_t triangle_count, const double* points,
                                                uint64_t point_count, uint32_t* triangles, double* weights,
                                                EfsiError* error);

#ifdef __cplusplus
}
#endif
#endif
