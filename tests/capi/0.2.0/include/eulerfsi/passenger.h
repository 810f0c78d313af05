/** @file
 * eulerfsi: passengers: points that follow a solid and do not act on it. */
#ifndef EULERFSI_PASSENGER_H
#define EULERFSI_PASSENGER_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** Adds points that follow the material of a solid; allowed at any time. They have no mass and no volume and are not
 * part of the state: their positions follow from the state of the solid.
 * @param solid its id
 * @param points 3*point_count floats, their positions when the solid is in its rest shape [m]; copied
 * @param point_count number of points
 * @param[out] id 1-based and stable; may be NULL
 * @retval EFSI_ERROR_ARGUMENT a point more than 6 voxels outside the solid */
EFSI_API EfsiStatus efsi_passenger_add(struct EfsiSim* sim, uint32_t solid, const float* points, uint64_t point_count,
                                       uint32_t* id);

/** Returns the current positions and velocities of the points, in the order in which they were added.
 * @param id of the passenger
 * @param[out] points 3*point_count floats [m]; may be NULL
 * @param[out] velocities 3*point_count floats [m/s]; may be NULL
 * @param point_count number of points
 * @retval EFSI_ERROR_ARGUMENT another point_count */
EFSI_API EfsiStatus efsi_passenger_get_points(const struct EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                              uint64_t point_count);

#ifdef __cplusplus
}
#endif
#endif
