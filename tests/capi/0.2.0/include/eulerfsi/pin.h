/** @file
 * eulerfsi: prescribed motion: of a part of a solid (pins) or of a whole body (colliders). */
#ifndef EULERFSI_PIN_H
#define EULERFSI_PIN_H

#include "eulerfsi/base.h"
#include "eulerfsi/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** Reaction of a pin during one step: what it exerts on its solid or, of a collider, on everything in contact with it.
 * Divided by the length of the step: force, torque and power. */
typedef struct EfsiPinReaction {
  EfsiVec3 impulse;         /**< [kg m/s] */
  EfsiVec3 angular_impulse; /**< about `center` [kg m^2/s] */
  EfsiVec3 center;          /**< of the prescribed rotation, at the start of the step [m] */
  double work;              /**< done by the prescribed motion [J] */
} EfsiPinReaction;

/** Pins the material of a solid that lies in a volume; allowed before the first step only.
 * @param solid its id
 * @param volume in the space of the rest shape, made for the simulation's voxel size
 * @param[out] id of the pin, 1-based and stable; may be NULL
 * @retval EFSI_ERROR_ARGUMENT the volume contains no node of the solid */
EFSI_API EfsiStatus efsi_pin_add_volume(struct EfsiSim* sim, uint32_t solid, const EfsiSurface* volume, uint32_t* id);

/** Pins the material of a solid within one voxel of marked vertices of its mesh, or of edges and triangles between
 * marked vertices; allowed before the first step only.
 * @param solid its id
 * @param marked one byte per vertex, non-zero where it is marked
 * @param count number of vertices of the mesh
 * @param[out] id of the pin, 1-based and stable; may be NULL */
EFSI_API EfsiStatus efsi_pin_add_vertices(struct EfsiSim* sim, uint32_t solid, const uint8_t* marked, uint64_t count,
                                          uint32_t* id);

/** Adds a collider, a body with prescribed motion that acts on solids and fluid; allowed before the first step only. It
 * may cross the faces of the box, lie outside it and overlap other colliders.
 * @param def mesh or surface and friction are used, the rest is ignored
 * @param[out] solid its id among the solids; may be NULL
 * @param[out] pin its id for efsi_pin_set_motion and efsi_collider_set_points; may be NULL
 * @retval EFSI_ERROR_MESH the mesh bounds no volume */
EFSI_API EfsiStatus efsi_collider_add(struct EfsiSim* sim, const EfsiSolidDef* def, uint32_t* solid, uint32_t* pin);

/** Moves a pin or a collider from one pose to another between two times: its centre at constant velocity, with a
 * rotation about the centre at constant rate by the smaller angle. Before start and after end it is at rest. Call it
 * between two calls of efsi_simulation_advance. The motion is not part of the state and has to be set again after
 * efsi_simulation_restore_checkpoint.
 * @param id of the pin
 * @param start [s]
 * @param end [s]
 * @param from row-major 4x4, rigid, applied to the rest position: the current pose, the identity for what has not moved
 *   yet
 * @param to likewise
 * @retval EFSI_ERROR_ARGUMENT a matrix that is not rigid */
EFSI_API EfsiStatus efsi_pin_set_motion(struct EfsiSim* sim, uint32_t id, double start, double end,
                                        const double from[16], const double to[16]);

/** Deforms the surface of a collider from one set of points to another between two times: each point moves at constant
 * velocity. Before start and after end it is at rest. Its faces do not change. Call it between two calls of
 * efsi_simulation_advance. The motion is not part of the state and has to be set again after
 * efsi_simulation_restore_checkpoint.
 * @param pin its id from efsi_collider_add
 * @param start [s]
 * @param end [s]
 * @param from 3*point_count floats, the current positions of the mesh's points in the rest pose [m], to which the poses
 *   of efsi_pin_set_motion are applied
 * @param to likewise, the positions at `end`
 * @param point_count number of points of the mesh
 * @retval EFSI_ERROR_MESH here or from efsi_simulation_advance: the points bound no volume */
EFSI_API EfsiStatus efsi_collider_set_points(struct EfsiSim* sim, uint32_t pin, double start, double end,
                                             const float* from, const float* to, uint64_t point_count);

/** Returns the reaction of a pin in the last step; zeros before the first step.
 * @param id of the pin
 * @param[out] reaction the reaction
 * @param size sizeof *reaction */
EFSI_API EfsiStatus efsi_pin_get_reaction(const struct EfsiSim* sim, uint32_t id, EfsiPinReaction* reaction,
                                          size_t size);

#ifdef __cplusplus
}
#endif
#endif
