/* eulerfsi: motion that is given: pins hold a part of a solid, colliders are given as a whole. */
#ifndef EULERFSI_PIN_H
#define EULERFSI_PIN_H

#include "eulerfsi/base.h"
#include "eulerfsi/solid.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/* What held the nodes of a pin in a step. Over the step's length: force, torque and power on the solid, or, of a
 * collider, on all that it meets. */
typedef struct EfsiPinReaction {
  EfsiVec3 impulse;         /* [kg m/s] */
  EfsiVec3 angular_impulse; /* about `center` [kg m^2/s] */
  EfsiVec3 center;          /* about which the given motion turned, at the start of the step [m] */
  double work;              /* of the given motion [J] */
} EfsiPinReaction;

/* Holds a solid where its material lies in a volume. solid: its id. volume: around the solid as it lies at rest, made
 * for the simulation's voxel size. id: out, of the pin, 1-based and stable. Before the first step.
 * EFSI_ERROR_ARGUMENT where no node of the solid lies in it. */
EFSI_API EfsiStatus efsi_pin_add_volume(struct EfsiSim* sim, uint32_t solid, const EfsiSurface* volume, uint32_t* id);
/* The same where it lies within a voxel of marked vertices of its mesh, or of edges and triangles between such.
 * marked: one byte per vertex, not 0 where it is; count: as many as the mesh has. */
EFSI_API EfsiStatus efsi_pin_add_vertices(struct EfsiSim* sim, uint32_t solid, const uint8_t* marked, uint64_t count,
                                          uint32_t* id);
/* Adds a solid all of which moves as given: solids and fluid meet it, and nothing moves it. Of the definition mesh or
 * surface and friction count. It may lie across the faces of the box, outside it, and in other colliders. Before the
 * first step. solid: out, its id among the solids; pin: out, the id by which it is moved. report may be NULL. */
EFSI_API EfsiStatus efsi_collider_add(struct EfsiSim* sim, const EfsiSolidDef* def, uint32_t* solid, uint32_t* pin,
                                      EfsiMeshReport* report);
/* What a pin holds moves from one pose to the next between two times [s]: its centre straight ahead at one speed, while
 * it turns about that at one rate by the smaller angle. Before and after it rests. from, to: row-major 4x4, rigid; they
 * place what is at rest, so that both are the identity where nothing has moved yet. Between two calls of
 * efsi_simulation_advance, at any time; `from` has to be where it is. Not part of the state: after
 * efsi_simulation_restore_checkpoint it is given again. */
EFSI_API EfsiStatus efsi_pin_set_motion(struct EfsiSim* sim, uint32_t id, double start, double end,
                                        const double from[16], const double to[16]);
/* The surface of a collider deforms from one set of points to the next between two times [s]: each point goes straight
 * ahead at one speed. Before and after it rests. pin: its id, as efsi_collider_add gives it. from, to: 3*point_count
 * floats each, where the points of its mesh are at rest [m]: the poses of efsi_pin_set_motion act on them. point_count:
 * as many as the mesh has, whose faces stay. A closed mesh keeps bounding a volume. Between two calls of
 * efsi_simulation_advance, at any time; `from` has to be where they are. Not part of the state: after
 * efsi_simulation_restore_checkpoint it is given again. EFSI_ERROR_MESH, here or from efsi_simulation_advance, where
 * the points bound no volume. */
EFSI_API EfsiStatus efsi_collider_set_points(struct EfsiSim* sim, uint32_t pin, double start, double end,
                                             const float* from, const float* to, uint64_t point_count);
/* What held the nodes of a pin in the last step [kg m/s]: over its length the force on the solid, or on all that a
 * collider meets; zero before. */
EFSI_API EfsiStatus efsi_pin_get_impulse(const struct EfsiSim* sim, uint32_t id, EfsiVec3* impulse);
/* The same with torque and work; zeros before the first step. */
EFSI_API EfsiStatus efsi_pin_get_reaction(const struct EfsiSim* sim, uint32_t id, EfsiPinReaction* reaction);

#ifdef __cplusplus
}
#endif
#endif
