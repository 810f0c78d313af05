/* eulerfsi: meshes and elastic solids. */
#ifndef EULERFSI_SOLID_H
#define EULERFSI_SOLID_H

#include "eulerfsi/base.h"
#include "eulerfsi/profile.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/* A polygon mesh as the caller holds it; nothing is copied until a function says so. */
typedef struct EfsiMeshView {
  const float* points; /* x y z of point i at (char*)points + i*point_stride [m] */
  uint64_t point_count;
  uint64_t point_stride;             /* bytes; 0 means 12 */
  const int32_t* face_vertex_counts; /* NULL: all faces are triangles */
  uint64_t face_count;
  const int32_t* face_vertex_indices;
  uint64_t index_count;
} EfsiMeshView;

/* What was found in a mesh and what was done about it. */
typedef struct EfsiMeshReport {
  double surface_volume;           /* signed volume of the mesh as given [m^3] */
  double solid_volume;             /* volume of the closed solid [m^3] */
  EfsiVec3 extent_min, extent_max; /* [m] */
  uint64_t triangles;
  uint64_t open_edges;        /* edges with one face */
  uint64_t holes;             /* closed loops of open edges */
  double largest_hole;        /* length of the longest such loop [m] */
  uint64_t nonmanifold_edges; /* edges with three faces and more */
  int32_t closed;             /* 1: no open edge */
  int32_t repaired;           /* 1: something was repaired; efsi_surface_get_repairs says what */
  double thinnest_feature;    /* estimate of the smallest thickness of the solid [m] */
  double closing_radius;      /* offset used to close the mesh [m]; 0: none */
  uint32_t pieces;            /* that no edge connects */
  uint32_t joined_points;     /* points of faces that lay on another one and were joined with it */
  uint32_t turned_triangles;  /* turned because they were inside out, alone or with their piece or the whole mesh */
  uint32_t inner_triangles;   /* left out, whole or in part: they lie inside the solid */
  uint32_t separate_pieces;   /* groups of pieces that do not touch; of a solid more than one is a poor one */
} EfsiMeshReport;

/* A mesh read from a file. The suffix of path, in upper or lower case, is its format:
 * obj, ply, stl, off, gltf, glb, fbx, dae, 3ds. Another suffix, or content that does not match, is EFSI_ERROR_MESH.
 * The file is read in this process. A damaged or hostile one can take all memory, crash the reader or never end: a host
 * that reads files it does not trust should call this in a process of its own, with a limit on memory and time. */
typedef struct EfsiMesh EfsiMesh;
EFSI_API EfsiStatus efsi_mesh_load(const char* path, EfsiMesh** mesh, EfsiError* error);
EFSI_API EfsiStatus efsi_mesh_get_view(const EfsiMesh* mesh, EfsiMeshView* view);
EFSI_API void efsi_mesh_destroy(EfsiMesh* mesh);

/* A mesh examined for one voxel size: the solid that it bounds, ready for any number of simulations and threads. */
typedef struct EfsiSurface EfsiSurface;
/* Called on the caller's thread now and then. fraction: part of the examination done, 0..1. Return non-zero to cancel.
 */
typedef int32_t (*EfsiSurfaceProgress)(void* user, double fraction);
/* Examines a mesh; nothing of it is needed afterwards. voxel_size: of the simulations that it is for [m].
 * threads: 0: all processors that this process may use. progress may be NULL. */
EFSI_API EfsiStatus efsi_surface_create(const EfsiMeshView* mesh, double voxel_size, int32_t threads,
                                        EfsiSurfaceProgress progress, void* user, EfsiSurface** surface,
                                        EfsiError* error);
EFSI_API EfsiStatus efsi_surface_get_report(const EfsiSurface* surface, EfsiMeshReport* report);
/* What was found and repaired, in words, the warning that efsi_solid_add logs; "" for nothing. Lives as long as the
 * surface. */
EFSI_API const char* efsi_surface_get_repairs(const EfsiSurface* surface);
/* How two surfaces lie in each other. depth: out, diameter of the largest ball that lies in both [m], 0 where they do
 * not overlap; volume: out, of what lies in both [m^3]. Either may be NULL, as may error. efsi_solid_add refuses solids
 * that overlap by more than half a voxel. */
EFSI_API EfsiStatus efsi_surface_get_overlap(const EfsiSurface* a, const EfsiSurface* b, double* depth, double* volume,
                                             EfsiError* error);
/* The surface as a slab has it, a domain one cell thick between slip walls, from low to high along an axis (0 to 2)
 * [m]: its section halfway counts. slab: out, destroyed by itself; its report speaks of the slab. error may be NULL. A
 * mesh that does not reach through the slab is EFSI_ERROR_MESH. efsi_solid_add does the same with any other surface
 * there. */
EFSI_API EfsiStatus efsi_surface_lay_in_slab(const EfsiSurface* surface, int32_t axis, double low, double high,
                                             EfsiSurface** slab, EfsiError* error);
/* NULL is allowed. Simulations keep what they need. */
EFSI_API void efsi_surface_destroy(EfsiSurface* surface);

#define EFSI_MATERIAL_COROTATIONAL 0
#define EFSI_MATERIAL_STABLE_NEO_HOOKEAN 1
#define EFSI_MATERIAL_ST_VENANT_KIRCHHOFF 2

/* An elastic solid; fields and limits as in libeulerfsi/parameters.toml, scope "solid". */
typedef struct EfsiSolidDef {
  uint32_t struct_size;
  uint32_t magic;
  EfsiMeshView mesh;           /* rest shape, placed where it starts, simulation space [m]; copied */
  double density;              /* rho [kg/m^3] */
  double youngs_modulus;       /* E [Pa] */
  double poissons_ratio;       /* nu */
  double rayleigh_alpha;       /* C = alpha M + beta K, Eq. 8 [1/s] */
  double rayleigh_beta;        /* [s] */
  EfsiVec3 velocity;           /* initial [m/s] */
  EfsiVec3 angular_velocity;   /* initial, about the centre of volume [rad/s] */
  int32_t material;            /* EFSI_MATERIAL_* */
  int32_t compressible;        /* 1: the pressure does not keep its volume */
  const EfsiSurface* surface;  /* stands in for `mesh` where it is not NULL; made for the simulation's voxel size */
  double friction;             /* Coulomb's coefficient at walls; of two solids the mean */
  double plastic_yield_stress; /* von Mises' equivalent Kirchhoff stress at which it yields [Pa]; 0: never */
  double plastic_flow_rate;    /* at which stress above the yield stress relaxes [1/s] */
  double plastic_hardening;    /* growth of the yield stress per accumulated plastic strain [Pa] */
  EfsiVec3 stretch;            /* initial, along x y z about the centre of volume; its product is 0.1 to 10 */
  double contact_stiffness;    /* k of Eq. 14, of two solids the mean; EFSI_PRESET_PAPER2016 only [N/m] */
  uint64_t reserved[2];
} EfsiSolidDef;

EFSI_API EfsiStatus efsi_solid_def_init(EfsiSolidDef* def);
/* Adds a solid before the first step. id: out, 1-based and stable. report may be NULL. */
EFSI_API EfsiStatus efsi_solid_add(struct EfsiSim* sim, const EfsiSolidDef* def, uint32_t* id, EfsiMeshReport* report);
EFSI_API EfsiStatus efsi_solid_get_count(const struct EfsiSim* sim, uint32_t* count);
/* Positions [m] and velocities [m/s] of the embedded surface, in the point order of the mesh that was given.
 * points, velocities: 3*point_count floats each; either may be NULL. */
EFSI_API EfsiStatus efsi_solid_get_surface(struct EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                           uint64_t point_count);
EFSI_API EfsiStatus efsi_solid_get_diagnostics(struct EfsiSim* sim, uint32_t id, EfsiSolidDiagnostics* out);
EFSI_API EfsiStatus efsi_solid_get_transport_change(const struct EfsiSim* sim, uint32_t id, EfsiTransportChange* out);

#ifdef __cplusplus
}
#endif
#endif
