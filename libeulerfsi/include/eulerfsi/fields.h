/* eulerfsi: views of the grid fields. */
#ifndef EULERFSI_FIELDS_H
#define EULERFSI_FIELDS_H

#include "eulerfsi/base.h"

#ifdef __cplusplus
extern "C" {
#endif

struct EfsiSim;

#define EFSI_FIELD_VELOCITY 0           /* v of the fluid, 0 without, nodes, 3 components [m/s] */
#define EFSI_FIELD_PRESSURE 1           /* p less what is hydrostatic in the fluid, cells [Pa] */
#define EFSI_FIELD_SMOKE_DENSITY 2      /* cells */
#define EFSI_FIELD_SMOKE_TEMPERATURE 3  /* cells [K] */
#define EFSI_FIELD_SOLID_FRACTION 4     /* part of each cell that solids fill, cells */
#define EFSI_FIELD_SOLID_DISPLACEMENT 5 /* u of one solid, nodes of its band, 3 components [m] */
#define EFSI_FIELD_SOLID_VELOCITY 6     /* velocity of one solid, nodes of its band, 3 components [m/s] */

/* Component c of node or cell (i,j,k) is data[c][i + j*stride[1] + k*stride[2]]. Valid until the next call that
 * steps, restores or destroys. A field that the scene does not use has size 0 and data NULL. */
typedef struct EfsiFieldView {
  const float* data[3];
  int32_t components;
  int32_t size[3];
  int64_t stride[3]; /* in elements; stride[0] is 1 */
  EfsiVec3 origin;   /* position of element (0,0,0) [m] */
  double spacing;    /* h [m] */
  int32_t cell_centered;
  int32_t reserved;
} EfsiFieldView;

/* solid: id for the fields of one solid, 0 otherwise. */
EFSI_API EfsiStatus efsi_field_get_view(struct EfsiSim* sim, int32_t field, uint32_t solid, EfsiFieldView* view);
/* Replaces a whole field (initial conditions, tests). values: components * size[0]*size[1]*size[2] floats, component by
 * component, in view order without padding. VELOCITY, SMOKE_DENSITY, SMOKE_TEMPERATURE, SOLID_DISPLACEMENT and
 * SOLID_VELOCITY can be set, those of the fluid only where there is ambient fluid. */
EFSI_API EfsiStatus efsi_field_set(struct EfsiSim* sim, int32_t field, uint32_t solid, const float* values,
                                   uint64_t count);

#ifdef __cplusplus
}
#endif
#endif
