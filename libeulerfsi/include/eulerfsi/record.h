/** @file
 * eulerfsi: records of steps: counters, times per stage (columns of the paper's Table 2), contacts, energy. */
#ifndef EULERFSI_RECORD_H
#define EULERFSI_RECORD_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** What limits a step. */
typedef enum EfsiStepRule {
  EFSI_STEP_RULE_END = 0,          /**< the end of the duration, in one step */
  EFSI_STEP_RULE_MAXIMUM = 1,      /**< EfsiSimulationDef.max_time_step */
  EFSI_STEP_RULE_SPEED = 2,        /**< the speed of a solid */
  EFSI_STEP_RULE_STRAIN = 3,       /**< the strain or rotation of a solid in flight */
  EFSI_STEP_RULE_WALL = 4,         /**< a solid approaches a wall */
  EFSI_STEP_RULE_WALL_WAVE = 5,    /**< what a solid at a wall may lose of its energy, or shear waves in it */
  EFSI_STEP_RULE_SOLID = 6,        /**< two bodies approach each other */
  EFSI_STEP_RULE_SOLID_WAVE = 7,   /**< the same at another body */
  EFSI_STEP_RULE_FOLD = 8,         /**< folds of a solid approach each other */
  EFSI_STEP_RULE_FOLD_WAVE = 9,    /**< the same where its folds touch */
  EFSI_STEP_RULE_START = 10,       /**< the first step of a solid in a dense fluid */
  EFSI_STEP_RULE_COLLIDER = 11,    /**< the speed of a collider */
  EFSI_STEP_RULE_FLUID = 12,       /**< the speed of the fluid, a wall or a jet */
  EFSI_STEP_RULE_REPEATED = 13,    /**< a step that was rolled back */
  EFSI_STEP_RULE_FLIGHT_WAVE = 14, /**< as EFSI_STEP_RULE_WALL_WAVE, in flight */
} EfsiStepRule;

/** Counters and extrema of the steps of one call. */
typedef struct EfsiStepInfo {
  double time;                    /**< at the end of the step [s] */
  double dt;                      /**< of the last step [s] */
  uint64_t steps;                 /**< number of steps of this call */
  uint64_t velocity_iterations;   /**< of the velocity solves */
  uint64_t pressure_iterations;   /**< of the pressure solves */
  double velocity_residual;       /**< relative, of the last solve, in the norm of the preset's criterion */
  double pressure_residual;       /**< relative, of the last solve, in the norm of the preset's criterion */
  double divergence_before;       /**< 2-norm of div v before the projection [1/s] */
  double divergence_after;        /**< 2-norm of the divergence of the velocity that transports u and smoke [1/s] */
  double divergence_after_solid;  /**< divergence_after over cells owned by solids */
  double divergence_before_solid; /**< divergence_before over the same cells */
  double max_speed_solid;         /**< [m/s] */
  double max_speed_fluid;         /**< [m/s] */
  double min_det_f;               /**< over the elements of all solids; 1 without elements */
  double max_det_f;               /**< likewise */
  uint64_t degenerate_cells;      /**< cells whose F was clamped, or whose map was rejected or rebuilt */
  uint64_t retries;               /**< steps that were rolled back and repeated shorter */
  uint64_t unconverged;           /**< solves that stopped at their iteration limit */
  int32_t limit_rule;             /**< EfsiStepRule: what limited the last step */
  uint32_t limiting_solid;        /**< id of the solid, or collider, that it looked at; 0: none */
  uint32_t limiting_other;        /**< id of the other one, where it looked at two */
  uint32_t padding;               /**< unused */
} EfsiStepInfo;

/** Stages of a step in the profile. */
typedef enum EfsiStage {
  EFSI_STAGE_TIME_STEP = 0,       /**< line 1 */
  EFSI_STAGE_SOLID_MASS = 1,      /**< lines 3, 7: masses of solids, of all matter beside them */
  EFSI_STAGE_COMPUTE_G = 2,       /**< lines 4, 8: "Compute G" */
  EFSI_STAGE_FLUID_FORCES = 3,    /**< lines 7, 8: one velocity, forces, viscosity */
  EFSI_STAGE_VELOCITY_SOLVE = 4,  /**< lines 9, 11 */
  EFSI_STAGE_PRESSURE_SOLVE = 5,  /**< line 10 and the final projection */
  EFSI_STAGE_SOLID_ADVECTION = 6, /**< lines 13, 18-20, with the extension */
  EFSI_STAGE_FLUID_ADVECTION = 7, /**< line 22, velocity */
  EFSI_STAGE_SMOKE = 8,           /**< line 22, smoke, emitters */
  EFSI_STAGE_CONTACT = 9,         /**< line 14 */
  EFSI_STAGE_SURFACE = 10,        /**< embedded surface meshes */
  EFSI_STAGE_CHECK = 11,          /**< state check, backup for the retry */
  EFSI_STAGE_OTHER = 12,          /**< total minus all of the above */
  EFSI_STAGE_COUNT = 13,          /**< number of stages */
} EfsiStage;

/** Sums of one stage over all steps since creation or the last reset. */
typedef struct EfsiStageProfile {
  double seconds; /**< wall time [s] */
  uint64_t tiles; /**< blocks of 8^3 nodes that the stage visited */
  uint64_t bytes; /**< field data that the stage read or wrote, each pass counted once [bytes] */
} EfsiStageProfile;

/** Sums over all steps since creation or the last reset. */
typedef struct EfsiProfile {
  double total_seconds;  /**< wall time of the steps [s] */
  uint64_t steps;        /**< number of steps */
  uint64_t memory_bytes; /**< currently held by fields and workspace [bytes] */
} EfsiProfile;

/** Cells of the last step with an invalid map, and det F of full cells after the transport and after the repair (1
 * without such cells; limited to 0.1 to 10, inverted cells count as 10). */
typedef struct EfsiRepairs {
  uint64_t clamped;        /**< cells whose F was clamped in the forces */
  uint64_t rejected;       /**< cells whose map was rejected after the transport */
  uint64_t broken;         /**< cells of incompressible solids with det F out of bounds after the transport */
  uint64_t repaired_cells; /**< cells that the repair moved, including those that it put out of bounds itself */
  double min_det_f_before, max_det_f_before; /**< after the transport */
  double min_det_f_after, max_det_f_after;   /**< after the repair */
} EfsiRepairs;

/** Contact between two solids. A row is a candidate contact point; rows are found anew in every step. Overlaps are the
 * largest at the starts of the steps, in edges of a cell; negative: a gap. With EFSI_PRESET_PAPER2016 a row is a
 * particle of either solid, and impulses act on the particles of solid[1] or, where that is a collider, are opposite to
 * those on the particles of solid[0]. With EFSI_PRESET_PRODUCTION contact between folds of one solid is listed, too,
 * with the same id twice; it keeps a minimum distance and has no friction; its `impulse`, of the solid on itself, is 0.
 */
typedef struct EfsiContactPair {
  uint32_t solid[2];           /**< ids, the smaller one first; equal: folds of one solid */
  uint64_t steps;              /**< number of steps with a contact impulse */
  uint64_t rows;               /**< rows, summed over these steps */
  uint64_t active_rows;        /**< rows with a non-zero normal impulse, summed over these steps */
  uint64_t sticking_rows;      /**< of active_rows, those that stick */
  double row_overlap;          /**< largest overlap of a row relative to the contact distance [cells] */
  double surface_overlap;      /**< largest depth of a row or vertex of one solid in the other [cells] */
  double normal_impulse;       /**< magnitude of the normal impulses, summed over rows and steps [N s] */
  EfsiVec3 impulse;            /**< of solid[0] on solid[1], friction included, summed over rows and steps [N s] */
  uint64_t exchanged_vertices; /**< vertices of either solid that came out of the other one on another side than that by
                                    which they went in: the solids have passed through each other */
  EfsiVec3 exchanged_place;    /**< where the first of them came out [m]; 0 where there is none */
} EfsiContactPair;

/** Stages of a step in the energy ledger. */
typedef enum EfsiEnergyStage {
  EFSI_ENERGY_WEIGHT = 0,          /**< weight minus buoyancy acts on the velocities */
  EFSI_ENERGY_MIXING = 1,          /**< velocities of solids and fluid are averaged at shared nodes */
  EFSI_ENERGY_EXTERNAL = 2,        /**< forces, emitters, buoyancy of smoke and heat, vorticity confinement */
  EFSI_ENERGY_WALLS = 3,           /**< wall conditions; one normal velocity where the fluid slips along solids */
  EFSI_ENERGY_VELOCITY = 4,        /**< velocity solve */
  EFSI_ENERGY_PRESSURE = 5,        /**< coupling step, pressure, projection */
  EFSI_ENERGY_SOLID_TRANSPORT = 6, /**< transport of u and v of the solids */
  EFSI_ENERGY_FLUID_TRANSPORT = 7, /**< transport of the fluid velocity */
  EFSI_ENERGY_REMAP = 8,           /**< changes of the cells that carry stiffness and of the fluid's mass at nodes */
  EFSI_ENERGY_REPAIR = 9,          /**< repair of cells with an invalid map */
  EFSI_ENERGY_MOMENTUM = 10,       /**< restoration of the solids' momenta */
  EFSI_ENERGY_PLASTIC_FLOW = 11,   /**< dissipation by plastic flow */
  EFSI_ENERGY_VISCOSITY = 12,      /**< dissipation by viscosity minus the work of moving walls */
  EFSI_ENERGY_STAGE_COUNT = 13,    /**< number of stages */
} EfsiEnergyStage;

/** Energies of the whole scene. */
typedef struct EfsiEnergy {
  double solid_kinetic, elastic, fluid_kinetic, potential; /**< [J] */
} EfsiEnergy;

/** Energy of the last step. `at_end` minus the sum of the changes of all stages is the energy at the beginning of the
 * step. A step ends with the velocity that transported u, which belongs to a time half a step earlier; `at_start` takes
 * u and v at the same time, that of the beginning of the step. */
typedef struct EfsiEnergyLedger {
  EfsiEnergy at_end;   /**< after the step */
  EfsiEnergy at_start; /**< before it, u and v at the same time */
  double source_work;  /**< work of the pressure on the volume source, a part of EFSI_ENERGY_PRESSURE [J] */
} EfsiEnergyLedger;

/** Returns time, steps and memory since creation or the last reset.
 * @param[out] profile the sums
 * @param size sizeof *profile */
EFSI_API EfsiStatus efsi_simulation_get_profile(const struct EfsiSim* sim, EfsiProfile* profile, size_t size);

/** Returns times, tiles and bytes of the stages since creation or the last reset, in the order of EfsiStage.
 * @param[out] stages the first `capacity` of them; may be NULL where capacity is 0
 * @param stage_size sizeof *stages
 * @param capacity number of elements of `stages`
 * @param[out] count number of stages that the library knows; may be NULL */
EFSI_API EfsiStatus efsi_simulation_get_stages(const struct EfsiSim* sim, EfsiStageProfile* stages, size_t stage_size,
                                               uint64_t capacity, uint64_t* count);

/** Resets the sums of the profile to 0. */
EFSI_API EfsiStatus efsi_simulation_reset_profile(struct EfsiSim* sim);

/** Returns the repairs of the last step.
 * @param[out] out the repairs
 * @param size sizeof *out */
EFSI_API EfsiStatus efsi_simulation_get_repairs(const struct EfsiSim* sim, EfsiRepairs* out, size_t size);

/** Returns the pairs of solids with a contact impulse in the last call of efsi_simulation_step or
 * efsi_simulation_advance, in the order of their ids; from a progress callback those of the call so far.
 * @param[out] pairs the first `capacity` of them; may be NULL where capacity is 0
 * @param pair_size sizeof *pairs
 * @param capacity number of elements of `pairs`
 * @param[out] count number of pairs */
EFSI_API EfsiStatus efsi_simulation_get_contacts(const struct EfsiSim* sim, EfsiContactPair* pairs, size_t pair_size,
                                                 uint64_t capacity, uint64_t* count);

/** Returns the energy ledger of the last step; zeros before the first step.
 * @param[out] out the ledger
 * @param size sizeof *out
 * @retval EFSI_ERROR_ARGUMENT EfsiSimulationDef.energy_ledger is 0 */
EFSI_API EfsiStatus efsi_simulation_get_energy_ledger(const struct EfsiSim* sim, EfsiEnergyLedger* out, size_t size);

/** Returns the energy changes of the stages of the last step, in the order of EfsiEnergyStage; zeros before the first
 * step.
 * @param[out] changes the first `capacity` of them; may be NULL where capacity is 0
 * @param capacity number of elements of `changes`
 * @param[out] count number of stages that the library knows; may be NULL
 * @retval EFSI_ERROR_ARGUMENT EfsiSimulationDef.energy_ledger is 0 */
EFSI_API EfsiStatus efsi_simulation_get_energy_changes(const struct EfsiSim* sim, EfsiEnergy* changes,
                                                       uint64_t capacity, uint64_t* count);

#ifdef __cplusplus
}
#endif
#endif
