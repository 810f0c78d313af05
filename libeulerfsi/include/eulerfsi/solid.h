/* eulerfsi: meshes and elastic solids. */
#ifndef EULERFSI_SOLID_H
#define EULERFSI_SOLID_H

#include "eulerfsi/base.h"
#include "eulerfsi/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/* A polygon mesh in the caller's memory; functions copy from it only where their comment says so. */
typedef struct EfsiMeshView {
  const float* points; /* x y z of point i at (char*)points + i*point_stride [m] */
  uint64_t point_count;
  uint64_t point_stride;             /* bytes; 0 means 12 */
  const int32_t* face_vertex_counts; /* NULL: all faces are triangles */
  uint64_t face_count;
  const int32_t* face_vertex_indices;
  uint64_t index_count;
} EfsiMeshView;

/* Properties of a mesh and of its repair. */
typedef struct EfsiMeshReport {
  double surface_volume;           /* signed volume of the mesh as passed [m^3] */
  double solid_volume;             /* volume of the closed solid [m^3] */
  EfsiVec3 extent_min, extent_max; /* [m] */
  uint64_t triangles;
  uint64_t open_edges;         /* edges with one face */
  uint64_t holes;              /* closed loops of open edges */
  double largest_hole;         /* length of the longest such loop [m] */
  uint64_t nonmanifold_edges;  /* edges with three or more faces */
  int32_t closed;              /* 1: no open edge */
  int32_t repaired;            /* 1: the mesh was repaired; efsi_surface_get_repair_text describes it */
  double thinnest_feature;     /* estimate of the smallest thickness of the solid [m] */
  double closing_radius;       /* offset used to close the mesh [m]; 0: none */
  uint32_t pieces;             /* parts that no edge connects */
  uint32_t merged_points;      /* coincident points that were merged */
  uint32_t reversed_triangles; /* triangles whose orientation was reversed, alone or with their piece or the mesh */
  uint32_t inner_triangles;    /* triangles inside the solid, removed in whole or in part */
  uint32_t separate_pieces;    /* groups of pieces that do not touch; a solid should have one */
} EfsiMeshReport;

/* A mesh that was read from a file. */
typedef struct EfsiMesh EfsiMesh;
/* Reads a mesh file. path: UTF-8; its suffix, in upper or lower case, is the format:
 * obj, ply, stl, off, gltf, glb, fbx, dae, 3ds. mesh: out; error may be NULL. EFSI_ERROR_MESH for another suffix or
 * content that does not match it, EFSI_ERROR_IO where the file cannot be read. The file is read in this process: a
 * damaged or hostile file can exhaust memory, crash the reader or never finish. To read untrusted files, call this
 * function in a child process with limits on memory and time. */
EFSI_API EfsiStatus efsi_mesh_load(const char* path, EfsiMesh** mesh, EfsiError* error);
/* Returns a view of a mesh, valid until it is destroyed. */
EFSI_API EfsiStatus efsi_mesh_get_view(const EfsiMesh* mesh, EfsiMeshView* view);
/* Destroys a mesh; NULL is allowed. */
EFSI_API void efsi_mesh_destroy(EfsiMesh* mesh);

/* The solid bounded by a mesh, prepared for one voxel size. It is constant and may be used by any number of simulations
 * and threads. */
typedef struct EfsiSurface EfsiSurface;
/* Reports progress on the caller's thread. fraction: completed part, 0 to 1. Returns non-zero to cancel. */
typedef int32_t (*EfsiSurfaceProgress)(void* user, double fraction);
/* Creates the surface of a mesh, which is copied. voxel_size: that of the simulations that will use it [m]. threads: 0
 * for all processors that this process may use. progress may be NULL; user is passed to it. surface: out; error may be
 * NULL. EFSI_ERROR_MESH for a mesh that does not define a solid, EFSI_ERROR_CANCELLED after a cancellation by progress.
 */
EFSI_API EfsiStatus efsi_surface_create(const EfsiMeshView* mesh, double voxel_size, int32_t threads,
                                        EfsiSurfaceProgress progress, void* user, EfsiSurface** surface,
                                        EfsiError* error);
/* Returns the properties and repairs of the mesh. */
EFSI_API EfsiStatus efsi_surface_get_report(const EfsiSurface* surface, EfsiMeshReport* report);
/* Returns the description of the repairs that efsi_solid_add logs as a warning; "" where there is none. Valid as long
 * as the surface. */
EFSI_API const char* efsi_surface_get_repair_text(const EfsiSurface* surface);
/* Measures the overlap of two surfaces. depth: out, diameter of the largest ball inside both [m], 0 without overlap;
 * volume: out, of their intersection [m^3]; depth, volume and error may be NULL. efsi_solid_add refuses solids that
 * overlap by more than half a voxel. */
EFSI_API EfsiStatus efsi_surface_get_overlap(const EfsiSurface* a, const EfsiSurface* b, double* depth, double* volume,
                                             EfsiError* error);
/* Extrudes the section of a surface for a slab, a domain one cell thick between slip walls, from low to high [m] along
 * an axis (0 to 2); the section halfway is taken. slab: out, a surface of its own with the report of the slab, to be
 * destroyed separately; error may be NULL. EFSI_ERROR_MESH for a mesh that does not extend through the slab. In such a
 * domain efsi_solid_add does this itself with any other surface. */
EFSI_API EfsiStatus efsi_surface_extrude_in_slab(const EfsiSurface* surface, int32_t axis, double low, double high,
                                                 EfsiSurface** slab, EfsiError* error);
/* Destroys a surface; NULL is allowed. Simulations that use it are not affected. */
EFSI_API void efsi_surface_destroy(EfsiSurface* surface);

#define EFSI_MATERIAL_COROTATIONAL 0
#define EFSI_MATERIAL_STABLE_NEO_HOOKEAN 1
#define EFSI_MATERIAL_ST_VENANT_KIRCHHOFF 2

/* An elastic solid. Fields and limits: libeulerfsi/parameters.toml, scope "solid". */
typedef struct EfsiSolidDef {
  uint32_t struct_size;
  uint32_t magic;
  EfsiMeshView mesh;           /* rest shape at the initial position, simulation space [m]; copied */
  double density;              /* rho [kg/m^3] */
  double youngs_modulus;       /* E [Pa] */
  double poissons_ratio;       /* nu */
  double rayleigh_alpha;       /* damping C = alpha M + beta K of Eq. 8 [1/s] */
  double rayleigh_beta;        /* the same [s] */
  EfsiVec3 velocity;           /* initial [m/s] */
  EfsiVec3 angular_velocity;   /* initial, about the centre of volume [rad/s] */
  int32_t material;            /* EFSI_MATERIAL_* */
  int32_t compressible;        /* 1: no incompressibility constraint; the elastic law alone resists */
  const EfsiSurface* surface;  /* replaces `mesh` where it is not NULL; made for the simulation's voxel size */
  double friction;             /* Coulomb coefficient at walls; between two solids their mean */
  double plastic_yield_stress; /* von Mises equivalent Kirchhoff stress at yield [Pa]; 0: purely elastic */
  double plastic_flow_rate;    /* relaxation rate of stress above the yield stress [1/s] */
  double plastic_hardening;    /* increase of the yield stress per accumulated plastic strain [Pa] */
  EfsiVec3 stretch;            /* initial, along x y z about the centre of volume; its product is 0.1 to 10 */
  double contact_stiffness;    /* k of Eq. 14, between two solids their mean; EFSI_PRESET_PAPER2016 only [N/m] */
  uint64_t reserved[2];
} EfsiSolidDef;

/* Fills a definition with its header and the defaults. */
EFSI_API EfsiStatus efsi_solid_def_init(EfsiSolidDef* def);
/* Adds a solid; allowed before the first step only. id: out, 1-based and stable; id and report may be NULL.
 * EFSI_ERROR_ARGUMENT for a mesh that extends beyond the box or overlaps another solid by more than half a voxel,
 * EFSI_ERROR_MESH for one that does not define a solid or contains no cell. */
EFSI_API EfsiStatus efsi_solid_add(struct EfsiSim* sim, const EfsiSolidDef* def, uint32_t* id, EfsiMeshReport* report);
/* Returns the number of solids, colliders included. */
EFSI_API EfsiStatus efsi_solid_get_count(const struct EfsiSim* sim, uint32_t* count);
/* Returns positions [m] and velocities [m/s] of the embedded surface, in the point order of its mesh. points,
 * velocities: out, 3*point_count floats each; either may be NULL. EFSI_ERROR_ARGUMENT for another point_count. */
EFSI_API EfsiStatus efsi_solid_get_surface(struct EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                           uint64_t point_count);
/* Returns integrals and extrema of a solid. */
EFSI_API EfsiStatus efsi_solid_get_diagnostics(struct EfsiSim* sim, uint32_t id, EfsiSolidDiagnostics* out);
/* Returns the transport errors of a solid in the last step. */
EFSI_API EfsiStatus efsi_solid_get_transport_error(const struct EfsiSim* sim, uint32_t id, EfsiTransportError* out);

#ifdef __cplusplus
}
#endif
#endif
