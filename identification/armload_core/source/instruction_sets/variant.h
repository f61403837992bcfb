/* The table of all kernels for one instruction set; its file `batch_*.c` first defines LANES and TARGET (`lanes.h`). */

#ifndef ARMLOAD_VARIANT_H
#define ARMLOAD_VARIANT_H

#include "batch.h"
#include "vectorised/regressor.h"
#include "vectorised/arm_torque.h"
#include "vectorised/regressor_slope.h"
#include "vectorised/clearance.h"
#include "vectorised/payload_torque.h"

ENTRY void sines_cosines(ptrdiff_t count, const double *angle, double *sine, double *cosine)
{
    for (ptrdiff_t t = 0; t < count; t += LANES) {
        const group g = group_at(t, count);
        lanes s, c;
        sine_cosine(gathered(&g, angle, 1, 0), &s, &c);
        scattered(&g, &s, 1, sine, 1, 0);
        scattered(&g, &c, 1, cosine, 1, 0);
    }
}

/* Initialiser of the table; NAME is a string. */
#define ALL_KERNELS(NAME)                                                                                              \
    {                                                                                                                  \
        .name = NAME,                                                                                                  \
        .payload_regressor = payload_regressor,                                                                        \
        .body_regressor = body_regressor,                                                                              \
        .arm_torque = arm_torque,                                                                                      \
        .arm_torque_slope = arm_torque_slope,                                                                          \
        .regressor_slope = regressor_slope,                                                                            \
        .clearances = clearances,                                                                                      \
        .clearance_slope = clearance_slope,                                                                            \
        .payload_torque = payload_torque,                                                                              \
        .sine_cosine = sines_cosines,                                                                                  \
    }

#endif
