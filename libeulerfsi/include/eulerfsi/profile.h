/* eulerfsi: records of steps: counters, times per stage (columns of the paper's Table 2), contacts, energy. */
#ifndef EULERFSI_PROFILE_H
#define EULERFSI_PROFILE_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Counters and extrema of the steps of one call. */
typedef struct EfsiStepInfo {
  double time;    /* at the end of the step [s] */
  double dt;      /* of the last step [s] */
  uint64_t steps; /* number of steps of this call */
  uint64_t velocity_iterations;
  uint64_t pressure_iterations;
  double velocity_residual;      /* relative, of the last solve, in the norm of the preset's criterion */
  double pressure_residual;      /* relative, of the last solve, in the norm of the preset's criterion */
  double divergence_before;      /* 2-norm of div v before the projection [1/s] */
  double divergence_after;       /* 2-norm of the divergence of the velocity that transports u and smoke [1/s] */
  double divergence_after_solid; /* the same over cells owned by solids */
  double divergence_before_solid;
  double max_speed_solid; /* [m/s] */
  double max_speed_fluid; /* [m/s] */
  double min_det_f;       /* over the elements of all solids; 1 without elements */
  double max_det_f;
  uint64_t degenerate_cells; /* cells whose F was clamped, or whose map was rejected or rebuilt */
  uint64_t retries;          /* steps that were rolled back and repeated at half the size */
  uint64_t unconverged;      /* solves that stopped at their iteration limit */
  uint64_t reserved[4];
} EfsiStepInfo;

#define EFSI_STAGE_TIME_STEP 0       /* line 1 */
#define EFSI_STAGE_SOLID_MASS 1      /* line 3 */
#define EFSI_STAGE_COMPUTE_G 2       /* lines 4, 8: "Compute G" */
#define EFSI_STAGE_FLUID_FORCES 3    /* lines 7, 8: fluid mass, body forces */
#define EFSI_STAGE_VELOCITY_SOLVE 4  /* lines 9, 11 */
#define EFSI_STAGE_PRESSURE_SOLVE 5  /* line 10 and the final projection */
#define EFSI_STAGE_SOLID_ADVECTION 6 /* lines 13, 18-20, with the extension */
#define EFSI_STAGE_FLUID_ADVECTION 7 /* line 22, velocity */
#define EFSI_STAGE_SMOKE 8           /* line 22, smoke, emitters */
#define EFSI_STAGE_CONTACT 9         /* line 14 */
#define EFSI_STAGE_SURFACE 10        /* embedded surface meshes */
#define EFSI_STAGE_CHECK 11          /* state check, backup for the retry */
#define EFSI_STAGE_OTHER 12          /* total minus all of the above */
#define EFSI_STAGE_COUNT 13

/* Sums over all steps since creation or the last reset. */
typedef struct EfsiProfile {
  double seconds[EFSI_STAGE_COUNT]; /* wall time [s] */
  uint64_t tiles[EFSI_STAGE_COUNT]; /* blocks of 8^3 nodes that the stage visited */
  uint64_t bytes[EFSI_STAGE_COUNT]; /* field data that the stage read or wrote, each pass counted once [bytes] */
  double total_seconds;             /* [s] */
  uint64_t steps;
  uint64_t memory_bytes; /* currently held by fields and workspace [bytes] */
  uint64_t reserved[2];
} EfsiProfile;

/* The current state of one solid. Integrals are taken by cell fractions unless noted. */
typedef struct EfsiSolidDiagnostics {
  double mass;               /* [kg] */
  double rest_volume;        /* of the closed rest mesh [m^3] */
  double volume_cells;       /* by cell fractions [m^3] */
  double rest_volume_cells;  /* by cell fractions at the first step [m^3] */
  double volume_mesh;        /* enclosed by the embedded surface [m^3] */
  EfsiVec3 center;           /* of mass [m] */
  EfsiVec3 momentum;         /* [kg m/s] */
  EfsiVec3 angular_momentum; /* about the centre of mass [kg m^2/s] */
  double kinetic_energy;     /* [J] */
  double elastic_energy;     /* [J] */
  EfsiVec3 extent_min;       /* of the embedded surface [m] */
  EfsiVec3 extent_max;
  double min_det_f, max_det_f;
  uint64_t elements;         /* cells that carry stiffness */
  uint64_t memory_bytes;     /* of the fields of this solid [bytes] */
  double max_stretch;        /* largest principal stretch over elements with a valid map, at least 1 */
  uint64_t false_edges;      /* edges of the embedded surface longer than 4 * max_stretch times their rest length */
  double max_plastic_strain; /* largest accumulated equivalent plastic strain; 0 without a yield stress */
} EfsiSolidDiagnostics;

/* Cells of the last step with an invalid map, and det F of full cells after the transport and after the repair (1
 * without such cells; limited to 0.1 to 10, inverted cells count as 10). */
typedef struct EfsiRepairs {
  uint64_t clamped;        /* cells whose F was clamped in the forces */
  uint64_t rejected;       /* cells whose map was rejected after the transport */
  uint64_t broken;         /* cells of incompressible solids with det F out of bounds after the transport */
  uint64_t repaired_cells; /* cells that the repair moved, including those that it put out of bounds itself */
  double min_det_f_before, max_det_f_before;
  double min_det_f_after, max_det_f_after;
} EfsiRepairs;

/* Contact between two solids. A row is a candidate contact point; rows are found anew in every step. Overlaps are the
 * largest at the starts of the steps, in edges of a cell; negative: a gap. With EFSI_PRESET_PAPER2016 a row is a
 * particle of either solid, and impulses act on the particles of solid[1] or, where that is a collider, are opposite to
 * those on the particles of solid[0]. With EFSI_PRESET_PRODUCTION contact between folds of one solid is listed, too,
 * with the same id twice; it keeps a minimum distance and has no friction; its `impulse`, of the solid on itself, is 0.
 */
typedef struct EfsiContactPair {
  uint32_t solid[2];      /* ids, the smaller one first; equal: folds of one solid */
  uint64_t steps;         /* number of steps with a contact impulse */
  uint64_t rows;          /* rows, summed over these steps */
  uint64_t active_rows;   /* rows with a non-zero normal impulse, summed over these steps */
  uint64_t sticking_rows; /* of active_rows, those that stick */
  double row_overlap;     /* largest overlap of a row relative to the contact distance [cells] */
  double surface_overlap; /* largest depth of a row or vertex of one solid in the other [cells] */
  double normal_impulse;  /* magnitude of the normal impulses, summed over rows and steps [N s] */
  EfsiVec3 impulse;       /* of solid[0] on solid[1], friction included, summed over rows and steps [N s] */
} EfsiContactPair;

/* Errors of the transport of the last step in a solid, before any correction. Volumes: change relative to the rest
 * volume, minus the change that the volume source asked for, of an incompressible solid inside the box; 0 otherwise and
 * in preset paper2016. */
typedef struct EfsiTransportError {
  double volume_mesh, volume_cells;
  EfsiVec3 momentum;         /* [kg m/s] */
  EfsiVec3 angular_momentum; /* about the centre of mass [kg m^2/s] */
  double mass;               /* by cell fractions, before it is scaled, relative to the first step's, minus 1 */
} EfsiTransportError;

/* Stages of the energy ledger. */
#define EFSI_ENERGY_WEIGHT 0          /* weight minus buoyancy acts on the velocities */
#define EFSI_ENERGY_MIXING 1          /* velocities of solids and fluid are averaged at shared nodes */
#define EFSI_ENERGY_EXTERNAL 2        /* forces, emitters, buoyancy of smoke and heat, vorticity confinement */
#define EFSI_ENERGY_WALLS 3           /* wall conditions; one normal velocity where the fluid slips along solids */
#define EFSI_ENERGY_VELOCITY 4        /* velocity solve */
#define EFSI_ENERGY_PRESSURE 5        /* coupling step, pressure, projection */
#define EFSI_ENERGY_SOLID_TRANSPORT 6 /* transport of u and v of the solids */
#define EFSI_ENERGY_FLUID_TRANSPORT 7 /* transport of the fluid velocity */
#define EFSI_ENERGY_REMAP 8           /* changes of the cells that carry stiffness and of the fluid's mass at nodes */
#define EFSI_ENERGY_REPAIR 9          /* repair of cells with an invalid map */
#define EFSI_ENERGY_MOMENTUM 10       /* restoration of the solids' momenta */
#define EFSI_ENERGY_PLASTIC_FLOW 11   /* dissipation by plastic flow */
#define EFSI_ENERGY_VISCOSITY 12      /* dissipation by viscosity minus the work of moving walls */
#define EFSI_ENERGY_STAGE_COUNT 13

/* Energies of the whole scene. */
typedef struct EfsiEnergy {
  double solid_kinetic, elastic, fluid_kinetic, potential; /* [J] */
} EfsiEnergy;

/* Energy of the last step by stages. `end` minus the sum of all changes is the energy at the beginning of the step. A
 * step ends with the velocity that transported u, which belongs to a time half a step earlier; `at_start` takes u and v
 * at the same time, that of the beginning of the step. */
typedef struct EfsiEnergyLedger {
  EfsiEnergy end;
  EfsiEnergy at_start;
  EfsiEnergy change[EFSI_ENERGY_STAGE_COUNT];
  double source_work; /* work of the pressure on the volume source, a part of EFSI_ENERGY_PRESSURE [J] */
} EfsiEnergyLedger;

/* The current state of the fluid. */
typedef struct EfsiFluidDiagnostics {
  double kinetic_energy; /* [J] */
  EfsiVec3 momentum;     /* [kg m/s] */
  double max_speed;      /* [m/s] */
  double smoke;          /* integral of the smoke density [m^3] */
  double max_divergence; /* [1/s] */
  uint64_t reserved[2];
} EfsiFluidDiagnostics;

#ifdef __cplusplus
}
#endif
#endif
