/* eulerfsi: passengers: points that ride along with a solid and are drawn only. */
#ifndef EULERFSI_PASSENGER_H
#define EULERFSI_PASSENGER_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/* Adds points that the material of a solid carries, at any time. They have no mass and no volume, and no part in the
 * state: they follow from that of the solid. solid: its id. points: 3*point_count floats, where they are while the
 * solid is in its rest shape [m]; copied. id: out, 1-based and stable. EFSI_ERROR_ARGUMENT for a point that lies more
 * than 6 voxels outside the solid. */
EFSI_API EfsiStatus efsi_passenger_add(struct EfsiSim* sim, uint32_t solid, const float* points, uint64_t point_count,
                                       uint32_t* id);
/* Positions [m] and velocities [m/s] of its points now, in the order in which they were given.
 * points, velocities: 3*point_count floats each; either may be NULL. */
EFSI_API EfsiStatus efsi_passenger_get_points(const struct EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                              uint64_t point_count);

#ifdef __cplusplus
}
#endif
#endif
