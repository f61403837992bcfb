/* The derivative of a payload's regressor with respect to the motion.

   It is computed in reverse mode, one backward pass per group; differences of the regressor took seven times as
   long. */

#ifndef ARMLOAD_REGRESSOR_SLOPE_H
#define ARMLOAD_REGRESSOR_SLOPE_H

#include <stddef.h>

#include "chain.h"
#include "frames.h"
#include "geometry.h"
#include "lanes.h"

/* Twist or wrench of a body: angular and linear part. */
typedef struct {
    vec3 angular, linear;
} screw;

/* sum_i <a_i, dPhi_i>: the change of the torque at joint i for a body with the ten parameters a_i, one for each sample.
   With the joint screws S_i = (z_i, v_i) in flange coordinates,

       V = sum_i S_i dq_i,    dV = sum_i S_i ddq_i + sum_{i<j} (S_i x S_j) dq_i dq_j,    dS_i/dq_j = S_i x S_j, i < j,

   differentiated in reverse mode; by_x is the derivative with respect to x (Griewank, Walther, Evaluating Derivatives,
   2008). */
ENTRY void regressor_slope(const double *packed, int n, const double *bodies, ptrdiff_t samples, const double *q,
                           const double *dq, const double *ddq, double *slope)
{
    const double *flange = flange_of(packed, n);
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        motion m;
        screw joint[MOST_JOINTS], ahead[MOST_JOINTS] /* sum of S_j dq_j over j > i */, by_joint[MOST_JOINTS];
        lanes by_q[MOST_JOINTS], by_dq[MOST_JOINTS], by_ddq[MOST_JOINTS];
        gather_motion(&g, n, n, q, dq, ddq, &m);
        forward_pass(packed, n, &m, frames);

        /* joint screws, and the resulting twist (w, u) and acceleration (dw, a), in flange coordinates */
        const frame *last = frames + n - 1;
        const rotation r = turned_rotation(&last->axes, flange);
        const vec3 lever = turned_constant(&last->axes, flange[POSE_X], flange[POSE_Y], flange[POSE_Z]);
        const vec3 origin = sum(last->origin, lever);
        vec3 w = zero(), u = zero(), dw = zero(), a = zero();
        for (int i = n - 1; i >= 0; i--) {
            const vec3 axis = frames[i].axes.z;
            const vec3 z = turned_back(&r, axis);
            const vec3 v = turned_back(&r, cross(axis, difference(origin, frames[i].origin)));
            joint[i] = (screw){z, v};
            ahead[i] = (screw){w, u};
            dw = sum(dw, sum(times(m.ddq[i], z), times(m.dq[i], cross(z, w))));
            a = sum(a, sum(times(m.ddq[i], v), times(m.dq[i], sum(cross(z, u), cross(v, w)))));
            w = sum(w, times(m.dq[i], z));
            u = sum(u, times(m.dq[i], v));
        }
        /* specific force: acceleration of the body minus gravity */
        const vec3 upward = turned_back(&r, constant(packed));
        a = sum(a, sum(cross(w, u), upward));

        /* reverse pass through tau_i = v_i . F(a_i) + z_i . N(a_i) */
        vec3 by_a = zero(), by_dw = zero(), by_w = zero();
        for (int i = 0; i < n; i++) {
            lanes body[BODY_PARAMETERS];
            for (int c = 0; c < BODY_PARAMETERS; c++) {
                body[c] = gathered(&g, bodies, (ptrdiff_t)n * BODY_PARAMETERS, BODY_PARAMETERS * i + c);
            }
            const lanes mass = body[0], *inertia = body + 4;
            const vec3 first = {body[1], body[2], body[3]};
            const vec3 z = joint[i].angular, v = joint[i].linear;
            const vec3 inertia_w = tensor_times(inertia, w);
            const lanes ws = dot(w, first), ww = dot(w, w), vw = dot(v, w), vs = dot(v, first);
            by_joint[i].angular = sum(sum(cross(first, a), tensor_times(inertia, dw)), cross(w, inertia_w));
            by_joint[i].linear = sum(sum(times(mass, a), cross(dw, first)), difference(times(ws, w), times(ww, first)));
            by_a = sum(by_a, sum(times(mass, v), cross(z, first)));
            by_dw = sum(by_dw, sum(cross(first, v), tensor_times(inertia, z)));
            by_w = sum(by_w, sum(sum(times(ws, v), times(vw, first)), times(-2.0 * vs, w)));
            by_w = sum(by_w, sum(cross(inertia_w, z), tensor_times(inertia, cross(z, w))));
        }
        by_w = sum(by_w, cross(u, by_a)); /* the acceleration contains w x u */
        const vec3 by_u = cross(by_a, w);

        /* reverse pass through the twist and the screws, from the first joint */
        screw behind = {zero(), zero()}; /* sum of S_j dq_j over j < i */
        screw moved = {zero(), zero()};  /* derivative by a displacement of the screws j < i, which q_i moves */
        for (int i = 0; i < n; i++) {
            const vec3 z = joint[i].angular, v = joint[i].linear;
            const vec3 rest_w = difference(ahead[i].angular, behind.angular);
            const vec3 rest_u = difference(ahead[i].linear, behind.linear);
            by_q[i] = dot(z, moved.angular) + dot(v, moved.linear) + dot(by_a, cross(upward, z));
            by_dq[i] = dot(by_w, z) + dot(by_u, v) + dot(by_dw, cross(z, rest_w))
                       + dot(by_a, sum(cross(z, rest_u), cross(v, rest_w)));
            by_ddq[i] = dot(by_dw, z) + dot(by_a, v);
            const vec3 angular = sum(sum(by_joint[i].angular, times(m.ddq[i], by_dw)),
                                     times(m.dq[i], sum(by_w, sum(cross(rest_w, by_dw), cross(rest_u, by_a)))));
            const vec3 linear =
                sum(sum(by_joint[i].linear, times(m.ddq[i], by_a)), times(m.dq[i], sum(by_u, cross(rest_w, by_a))));
            moved.angular = sum(moved.angular, sum(cross(angular, z), cross(linear, v)));
            moved.linear = sum(moved.linear, cross(linear, z));
            behind.angular = sum(behind.angular, times(m.dq[i], z));
            behind.linear = sum(behind.linear, times(m.dq[i], v));
        }
        scattered(&g, by_q, n, slope, n, 0);
        scattered(&g, by_dq, n, slope + samples * n, n, 0);
        scattered(&g, by_ddq, n, slope + 2 * samples * n, n, 0);
    }
}

#endif
