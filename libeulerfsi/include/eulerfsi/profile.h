/* eulerfsi: what a step did: counters, times per stage (columns of the paper's Table 2), diagnostics. */
#ifndef EULERFSI_PROFILE_H
#define EULERFSI_PROFILE_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct EfsiStepInfo {
  double time;    /* at the end of the step [s] */
  double dt;      /* of the last step [s] */
  uint64_t steps; /* steps that this call made */
  uint64_t velocity_iterations;
  uint64_t pressure_iterations;
  double velocity_residual;      /* relative, last solve, to what the preset stops on */
  double pressure_residual;      /* relative, last solve, in the norm that the preset stops on */
  double divergence_before;      /* 2-norm of div v before the projection [1/s] */
  double divergence_after;       /* 2-norm of div of the velocity that moves u and smoke [1/s] */
  double divergence_after_solid; /* the same, cells owned by solids only */
  double divergence_before_solid;
  double max_speed_solid; /* [m/s] */
  double max_speed_fluid; /* [m/s] */
  double min_det_f;       /* over elements of all solids; 1 when there is none */
  double max_det_f;
  uint64_t degenerate_cells; /* cells whose F was clamped, whose map was not believed or was made anew */
  uint64_t retries;          /* steps that were rolled back and repeated with half the size */
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

/* Sums since creation or the last reset. */
typedef struct EfsiProfile {
  double seconds[EFSI_STAGE_COUNT];
  uint64_t tiles[EFSI_STAGE_COUNT]; /* blocks of 8^3 nodes that the stage visited */
  uint64_t bytes[EFSI_STAGE_COUNT]; /* bytes of field data that the stage read or wrote, one pass each */
  double total_seconds;
  uint64_t steps;
  uint64_t memory_bytes; /* held by fields and workspace now */
  uint64_t reserved[2];
} EfsiProfile;

/* One solid now. Integrals by cell fractions unless said. */
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
  uint64_t memory_bytes;     /* of this solid's band */
  double max_stretch;        /* largest principal stretch of a sound element, at least 1 */
  uint64_t false_edges;      /* edges of the embedded surface longer than 4 times what max_stretch explains */
  double max_plastic_strain; /* largest accumulated equivalent plastic strain; 0 where it cannot yield */
} EfsiSolidDiagnostics;

/* Cells whose map could not be, in the last step, and det F of full cells (1 where there is none; within 0.1 to 10,
 * inverted ones 10) after the transport and after the repair. */
typedef struct EfsiRepairs {
  uint64_t clamped;  /* cells whose F was clamped in the forces */
  uint64_t rejected; /* cells after the transport whose map was not believed */
  uint64_t broken;   /* cells of incompressible solids whose det F the transport has left out of bounds */
  uint64_t put_back; /* cells that the repair moved, with those that it broke itself */
  double min_det_f_before, max_det_f_before;
  double min_det_f_after, max_det_f_after;
} EfsiRepairs;

/* Two solids that have pushed each other. A row is a point where they may touch; rows are counted anew in every step.
 * Overlaps are the largest at the starts of these steps, in edges of a cell; < 0: they were apart by so much. With
 * EFSI_PRESET_PAPER2016 a row is a particle of either solid, and impulses are those on the particles of solid[1], or,
 * where that is a collider, against those of solid[0]. With EFSI_PRESET_PRODUCTION also folds of one solid that have
 * pushed each other: the same id twice; they keep a distance, have no friction, and `impulse`, of the solid on itself,
 * is 0. */
typedef struct EfsiContactPair {
  uint32_t solid[2];      /* ids, the smaller one first; the same twice: folds of it */
  uint64_t steps;         /* in which they did */
  uint64_t rows;          /* of these steps, summed */
  uint64_t pushing_rows;  /* those with an impulse */
  uint64_t sticking_rows; /* of these, those at which friction holds */
  double row_overlap;     /* what the deepest row was beyond what contact keeps between surfaces [cells] */
  double surface_overlap; /* how deep a row or vertex of one was in the other, without that skin [cells] */
  double normal_impulse;  /* magnitudes along the rows' normals, summed over rows and steps [N s] */
  EfsiVec3 impulse;       /* of solid[0] on solid[1], friction included, summed over them [N s] */
} EfsiContactPair;

/* What the transport of the last step changed in a solid before anything restored it. Volumes over those at rest, less
 * what the pressure was asked to give, of an incompressible solid that is whole; 0 otherwise and in preset paper2016.
 */
typedef struct EfsiTransportChange {
  double volume_mesh, volume_cells;
  EfsiVec3 momentum;         /* [kg m/s] */
  EfsiVec3 angular_momentum; /* about the centre of mass [kg m^2/s] */
  double mass;               /* as cells count it, over what they counted at the start, less 1 */
} EfsiTransportChange;

#define EFSI_ENERGY_WEIGHT 0          /* weight less buoyancy acts on the velocities */
#define EFSI_ENERGY_MIXING 1          /* one velocity at nodes that solids and fluid share */
#define EFSI_ENERGY_OUTSIDE 2         /* forces, emitters, smoke and heat, vorticity confinement */
#define EFSI_ENERGY_WALLS 3           /* walls; one normal velocity where the fluid slips */
#define EFSI_ENERGY_VELOCITY 4        /* velocity solve */
#define EFSI_ENERGY_PRESSURE 5        /* coupling step, pressure, projection */
#define EFSI_ENERGY_SOLID_TRANSPORT 6 /* u and v move with the solids */
#define EFSI_ENERGY_FLUID_TRANSPORT 7 /* the fluid's velocity moves */
#define EFSI_ENERGY_REMAP 8           /* which cells carry stiffness, how much fluid the nodes hold */
#define EFSI_ENERGY_REPAIR 9
#define EFSI_ENERGY_MOMENTUM 10     /* what restores the momenta */
#define EFSI_ENERGY_PLASTIC_FLOW 11 /* what plastic flow dissipates */
#define EFSI_ENERGY_VISCOSITY 12    /* what the viscous fluid dissipates, less what walls that move put in */
#define EFSI_ENERGY_STAGE_COUNT 13

typedef struct EfsiEnergy {
  double solid_kinetic, elastic, fluid_kinetic, potential; /* [J] */
} EfsiEnergy;

/* Of the last step. end less the sum of all changes is what it began with. A step ends with the velocity that has moved
 * u, that of half a step before; at_start has u and v of the time at which the step began. */
typedef struct EfsiEnergyLedger {
  EfsiEnergy end;
  EfsiEnergy at_start;
  EfsiEnergy change[EFSI_ENERGY_STAGE_COUNT];
  double source_work; /* of the pressure through the volume source: part of the stage pressure [J] */
} EfsiEnergyLedger;

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
