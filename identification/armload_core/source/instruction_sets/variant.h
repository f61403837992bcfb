/* All kernels for one instruction set: included once by each `batch_*.c`, which defines

       LANES      samples per vector
       TARGET     function attribute that selects the instruction set, or empty
       VARIANT    name of the table of kernels, batch_...
       NAME       its name as a string */

#include <stdlib.h>

#include "batch.h"
#include "chain.h"

#define INLINE static inline __attribute__((always_inline)) TARGET
#define ENTRY static TARGET

#include "vectorised/lanes.h"
#include "vectorised/geometry.h"
#include "vectorised/frames.h"
#include "vectorised/body_columns.h"
#include "vectorised/regressor.h"
#include "vectorised/arm_torque.h"
#include "vectorised/information.h"
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

const batch_kernels VARIANT = {
    .name = NAME,
    .payload_regressor = payload_regressor,
    .body_regressor = body_regressor,
    .arm_torque = arm_torque,
    .arm_torque_slope = arm_torque_slope,
    .information = information,
    .information_slope = information_slope,
    .clearances = clearances,
    .clearance_slope = clearance_slope,
    .payload_torque = payload_torque,
    .sine_cosine = sines_cosines,
};
