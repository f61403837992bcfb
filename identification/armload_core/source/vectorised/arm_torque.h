/* Torque of the complete arm and its derivative along a motion.

   One pass outwards through the frames, one inwards through the joints:

       tau = M(q) ddq + C(q, dq) dq + g(q)                    Chen 2016, eq. (1), without friction and rotors */

#ifndef ARMLOAD_ARM_TORQUE_H
#define ARMLOAD_ARM_TORQUE_H

#include <stddef.h>

#include "chain.h"
#include "frames.h"
#include "geometry.h"
#include "lanes.h"

/* `links` (n, 10) in the turned joint frames; `frames` is work space. */
INLINE void group_torque(const double *packed, int n, const double *links, const motion *m, frame *frames,
                         lanes *torque)
{
    vec3 force = zero(), moment = zero(); /* of all bodies from joint i outwards, about the base's origin */
    forward_pass(packed, n, m, frames);
    for (int i = n - 1; i >= 0; i--) {
        const frame *f = frames + i;
        const double *b = links + BODY_PARAMETERS * i;
        const lanes inertia[6] = {all(b[4]), all(b[5]), all(b[6]), all(b[7]), all(b[8]), all(b[9])};
        const vec3 first = turned_constant(&f->axes, b[1], b[2], b[3]);
        const vec3 w = turned_back(&f->axes, f->w), dw = turned_back(&f->axes, f->dw);
        const vec3 own_force = sum(times(all(b[0]), f->a), sum(cross(f->dw, first), cross(f->w, cross(f->w, first))));
        const vec3 own_moment = sum(tensor_times(inertia, dw), cross(w, tensor_times(inertia, w)));
        moment = sum(moment, sum(turned(&f->axes, own_moment), sum(cross(first, f->a), cross(f->origin, own_force))));
        force = sum(force, own_force);
        torque[i] = dot(f->axes.z, difference(moment, cross(f->origin, force)));
    }
}

ENTRY void arm_torque(const double *packed, int n, const double *links, ptrdiff_t samples, const double *q,
                      const double *dq, const double *ddq, double *out)
{
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        motion m;
        lanes torque[MOST_JOINTS];
        gather_motion(&g, n, n, q, dq, ddq, &m);
        group_torque(packed, n, links, &m, frames, torque);
        scattered(&g, torque, n, out, n, 0);
    }
}

/* The next LANES samples from *t on with a nonzero weight; the last group may hold fewer, or none. */
INLINE group weighted_group(ptrdiff_t *t, ptrdiff_t samples, int n, const double *weight)
{
    group g = {.used = 0};
    for (; *t < samples && g.used < LANES; ++*t) {
        for (int i = 0; i < n; i++) {
            if (weight[*t * n + i] != 0.0) {
                g.sample[g.used++] = *t;
                break;
            }
        }
    }
    for (int l = g.used; l < LANES && g.used > 0; l++) {
        g.sample[l] = g.sample[g.used - 1];
    }
    return g;
}

/* Steps of central differences. The torque is affine in ddq and quadratic in dq, so that in them a step of one is exact.
   In q the error is about 1e-10: a larger step has more of the third derivative, a smaller one more rounding. */
static const double STEP_RAD = 1e-5, STEP_EXACT = 1.0;

ENTRY void arm_torque_slope(const double *packed, int n, const double *links, const double *weight, ptrdiff_t samples,
                            const double *q, const double *dq, const double *ddq, double *slope)
{
    ptrdiff_t t = 0;
    for (;;) {
        const group g = weighted_group(&t, samples, n, weight);
        frame frames[MOST_JOINTS];
        motion m;
        lanes torque[MOST_JOINTS], by[MOST_JOINTS];
        if (g.used == 0) {
            return;
        }
        gather_motion(&g, n, n, q, dq, ddq, &m);
        for (int order = 0; order < 3; order++) {
            lanes *varied = order == 0 ? m.q : order == 1 ? m.dq : m.ddq;
            const double step = order == 0 ? STEP_RAD : STEP_EXACT;
            for (int j = 0; j < n; j++) {
                const lanes here = varied[j];
                lanes change = all(0.0);
                for (int side = 1; side >= -1; side -= 2) {
                    varied[j] = here + side * step;
                    group_torque(packed, n, links, &m, frames, torque);
                    for (int i = 0; i < n; i++) {
                        change += (double)side * gathered(&g, weight, n, i) * torque[i];
                    }
                }
                varied[j] = here;
                by[j] = change / (2.0 * step);
            }
            scattered(&g, by, n, slope + order * samples * n, n, 0);
        }
    }
}

#endif
