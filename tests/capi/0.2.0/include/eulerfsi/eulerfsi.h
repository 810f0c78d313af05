/** @file
 * eulerfsi: the whole C API; the header that clients include. */
#ifndef EULERFSI_EULERFSI_H
#define EULERFSI_EULERFSI_H

#include "eulerfsi/base.h"
#include "eulerfsi/fields.h"
#include "eulerfsi/fluid.h"
#include "eulerfsi/force.h"
#include "eulerfsi/io.h"
#include "eulerfsi/mesh.h"
#include "eulerfsi/passenger.h"
#include "eulerfsi/pin.h"
#include "eulerfsi/record.h"
#include "eulerfsi/simulation.h"
#include "eulerfsi/solid.h"

#endif
