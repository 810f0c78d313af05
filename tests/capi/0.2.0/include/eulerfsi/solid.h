/** @file
 * eulerfsi: elastic solids. */
#ifndef EULERFSI_SOLID_H
#define EULERFSI_SOLID_H

#include "eulerfsi/base.h"
#include "eulerfsi/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** Constitutive laws. */
typedef enum EfsiMaterial {
  EFSI_MATERIAL_COROTATIONAL = 0,        /**< corotated linear */
  EFSI_MATERIAL_STABLE_NEO_HOOKEAN = 1,  /**< stable Neo-Hookean */
  EFSI_MATERIAL_ST_VENANT_KIRCHHOFF = 2, /**< St. Venant-Kirchhoff */
  EFSI_MATERIAL_COUNT = 3,               /**< number of laws */
} EfsiMaterial;

/** An elastic solid. Fields and limits: libeulerfsi/parameters.toml, scope "solid". */
typedef struct EfsiSolidDef {
  uint32_t struct_size;        /**< set by the function that fills the definition */
  uint32_t magic;              /**< the same */
  EfsiMeshView mesh;           /**< rest shape at the initial position, simulation space [m]; copied */
  double density;              /**< rho [kg/m^3] */
  double youngs_modulus;       /**< E [Pa] */
  double poissons_ratio;       /**< nu */
  double rayleigh_alpha;       /**< damping C = alpha M + beta K of Eq. 8 [1/s] */
  double rayleigh_beta;        /**< the same [s] */
  EfsiVec3 velocity;           /**< initial [m/s] */
  EfsiVec3 angular_velocity;   /**< initial, about the centre of volume [rad/s] */
  int32_t material;            /**< EfsiMaterial */
  int32_t compressible;        /**< 1: no incompressibility constraint; the elastic law alone resists */
  const EfsiSurface* surface;  /**< replaces `mesh` where it is not NULL; made for the simulation's voxel size */
  double friction;             /**< Coulomb coefficient at walls; between two solids their mean */
  double plastic_yield_stress; /**< von Mises equivalent Kirchhoff stress at yield [Pa]; 0: purely elastic */
  double plastic_flow_rate;    /**< relaxation rate of stress above the yield stress [1/s] */
  double plastic_hardening;    /**< increase of the yield stress per accumulated plastic strain [Pa] */
  EfsiVec3 stretch;            /**< initial, along x y z about the centre of volume; its product is 0.1 to 10 */
  double contact_stiffness;    /**< k of Eq. 14, between two solids their mean; EFSI_PRESET_PAPER2016 only [N/m] */
} EfsiSolidDef;

/** Fills a definition with its header and the defaults.
 * @param size sizeof *def */
EFSI_API EfsiStatus efsi_solid_def_init(EfsiSolidDef* def, size_t size);

/** Adds a solid; allowed before the first step only.
 * @param def the solid, copied
 * @param[out] id 1-based and stable; may be NULL
 * @retval EFSI_ERROR_ARGUMENT the mesh extends beyond the box or overlaps another solid by more than half a voxel
 * @retval EFSI_ERROR_MESH the mesh does not define a solid or contains no cell */
EFSI_API EfsiStatus efsi_solid_add(struct EfsiSim* sim, const EfsiSolidDef* def, uint32_t* id);

/** Returns the properties and repairs of the mesh of a solid or collider.
 * @param id of the solid
 * @param[out] report the properties
 * @param size sizeof *report */
EFSI_API EfsiStatus efsi_solid_get_mesh_report(const struct EfsiSim* sim, uint32_t id, EfsiMeshReport* report,
                                               size_t size);

/** Returns the number of solids, colliders included.
 * @param[out] count the number */
EFSI_API EfsiStatus efsi_solid_get_count(const struct EfsiSim* sim, uint32_t* count);

/** Returns positions and velocities of the embedded surface, in the point order of its mesh.
 * @param id of the solid
 * @param[out] points 3*point_count floats [m]; may be NULL
 * @param[out] velocities 3*point_count floats [m/s]; may be NULL
 * @param point_count number of points of the mesh
 * @retval EFSI_ERROR_ARGUMENT another point_count */
EFSI_API EfsiStatus efsi_solid_get_surface(struct EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                           uint64_t point_count);

/** The current state of one solid. Integrals are taken by cell fractions unless noted. */
typedef struct EfsiSolidDiagnostics {
  double mass;                 /**< [kg] */
  double rest_volume;          /**< of the closed rest mesh [m^3] */
  double volume_cells;         /**< by cell fractions [m^3] */
  double rest_volume_cells;    /**< by cell fractions at the first step [m^3] */
  double volume_mesh;          /**< enclosed by the embedded surface [m^3] */
  EfsiVec3 center;             /**< of mass [m] */
  EfsiVec3 momentum;           /**< [kg m/s] */
  EfsiVec3 angular_momentum;   /**< about the centre of mass [kg m^2/s] */
  double kinetic_energy;       /**< [J] */
  double elastic_energy;       /**< [J] */
  EfsiVec3 extent_min;         /**< of the embedded surface [m] */
  EfsiVec3 extent_max;         /**< likewise */
  double min_det_f, max_det_f; /**< over the elements; 1 without elements */
  uint64_t elements;           /**< cells that carry stiffness */
  uint64_t memory_bytes;       /**< of the fields of this solid [bytes] */
  double max_stretch;          /**< largest principal stretch over elements with a valid map, at least 1 */
  uint64_t false_edges;        /**< edges of the embedded surface longer than 4 * max_stretch times their rest length */
  double max_plastic_strain;   /**< largest accumulated equivalent plastic strain; 0 without a yield stress */
} EfsiSolidDiagnostics;

/** Errors of the transport of the last step in a solid, before any correction. Volumes: change relative to the rest
 * volume, minus the change that the volume source asked for, of an incompressible solid inside the box; 0 otherwise and
 * in preset paper2016. */
typedef struct EfsiTransportError {
  double volume_mesh, volume_cells; /**< by mesh and by cell fractions */
  EfsiVec3 momentum;                /**< [kg m/s] */
  EfsiVec3 angular_momentum;        /**< about the centre of mass [kg m^2/s] */
  double mass; /**< by cell fractions, before it is scaled, relative to the first step's, minus 1 */
} EfsiTransportError;

/** Returns integrals and extrema of a solid.
 * @param id of the solid
 * @param[out] out the current state
 * @param size sizeof *out */
EFSI_API EfsiStatus efsi_solid_get_diagnostics(struct EfsiSim* sim, uint32_t id, EfsiSolidDiagnostics* out,
                                               size_t size);

/** Returns the transport errors of a solid in the last step.
 * @param id of the solid
 * @param[out] out the errors
 * @param size sizeof *out */
EFSI_API EfsiStatus efsi_solid_get_transport_error(const struct EfsiSim* sim, uint32_t id, EfsiTransportError* out,
                                                   size_t size);

#ifdef __cplusplus
}
#endif
#endif
