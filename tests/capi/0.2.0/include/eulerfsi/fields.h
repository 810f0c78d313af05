/** @file
 * eulerfsi: reading and replacing grid fields. */
#ifndef EULERFSI_FIELDS_H
#define EULERFSI_FIELDS_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

/** Grid fields. */
typedef enum EfsiField {
  EFSI_FIELD_VELOCITY = 0,           /**< nodes, 3 components: fluid velocity, 0 without ambient fluid [m/s] */
  EFSI_FIELD_PRESSURE = 1,           /**< cells: pressure minus the hydrostatic pressure of the fluid [Pa] */
  EFSI_FIELD_SMOKE_DENSITY = 2,      /**< cells: dimensionless */
  EFSI_FIELD_SMOKE_TEMPERATURE = 3,  /**< cells: difference from ambient [K] */
  EFSI_FIELD_SOLID_FRACTION = 4,     /**< cells: volume fraction filled by solids, 0 to 1 */
  EFSI_FIELD_SOLID_DISPLACEMENT = 5, /**< nodes of the solid's band, 3 components: u of one solid [m] */
  EFSI_FIELD_SOLID_VELOCITY = 6,     /**< nodes of the solid's band, 3 components: v of one solid [m/s] */
} EfsiField;

/** A view of a grid field: component c of node or cell (i,j,k) is data[c][i + j*stride[1] + k*stride[2]]. Valid until
 * the next call that steps, restores, sets or destroys. A field that the scene does not use has size 0 and data NULL.
 */
typedef struct EfsiFieldView {
  const float* data[3];  /**< of each component */
  int32_t components;    /**< 1 or 3 */
  int32_t size[3];       /**< elements along x, y, z */
  int64_t stride[3];     /**< in elements; stride[0] is 1 */
  EfsiVec3 origin;       /**< position of element (0,0,0) [m] */
  double spacing;        /**< h [m] */
  int32_t cell_centered; /**< 1: values at cell centres; 0: at nodes */
  int32_t padding;       /**< unused */
} EfsiFieldView;

/** Returns a view of a field.
 * @param field EfsiField
 * @param solid the id for a field of one solid, 0 otherwise
 * @param[out] view the view
 * @param size sizeof *view
 * @retval EFSI_ERROR_ARGUMENT an unknown field or solid */
EFSI_API EfsiStatus efsi_field_get_view(struct EfsiSim* sim, int32_t field, uint32_t solid, EfsiFieldView* view,
                                        size_t size);

/** Replaces a whole field, as an initial condition or in a test. EFSI_FIELD_VELOCITY, EFSI_FIELD_SMOKE_DENSITY,
 * EFSI_FIELD_SMOKE_TEMPERATURE, EFSI_FIELD_SOLID_DISPLACEMENT and EFSI_FIELD_SOLID_VELOCITY can be set; the first three
 * require ambient fluid.
 * @param field EfsiField
 * @param solid the id for a field of one solid, 0 otherwise
 * @param values components * size[0]*size[1]*size[2] floats in the units of the field, component by component, in view
 *   order without padding
 * @param count their number
 * @retval EFSI_ERROR_ARGUMENT another field, another count or a value that is not finite */
EFSI_API EfsiStatus efsi_field_set(struct EfsiSim* sim, int32_t field, uint32_t solid, const float* values,
                                   uint64_t count);

#ifdef __cplusplus
}
#endif
#endif
