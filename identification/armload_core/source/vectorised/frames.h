/* Pose and motion of an arm's turned joint frames in base coordinates.

   Gravity enters as an upward acceleration of the base. */

#ifndef ARMLOAD_FRAMES_H
#define ARMLOAD_FRAMES_H

#include "chain.h"
#include "geometry.h"
#include "lanes.h"

typedef struct {
    rotation axes;
    vec3 origin;
    vec3 w;  /* angular velocity */
    vec3 dw; /* angular acceleration */
    vec3 a;  /* acceleration of the origin */
} frame;

/* Joint positions, velocities and accelerations of a group of samples. */
typedef struct {
    lanes q[MOST_JOINTS], dq[MOST_JOINTS], ddq[MOST_JOINTS];
} motion;

INLINE void place_frames(const double *packed, int n, const lanes *q, frame *frames)
{
    const double *joint = joint_of(packed, 0);
    rotation r = {{all(1.0), all(0.0), all(0.0)}, {all(0.0), all(1.0), all(0.0)}, {all(0.0), all(0.0), all(1.0)}};
    vec3 origin = zero();
    for (int i = 0; i < n; i++, joint += POSE_NUMBERS) {
        lanes s, c;
        sine_cosine(q[i], &s, &c);
        origin = sum(origin, turned_constant(&r, joint[POSE_X], joint[POSE_Y], joint[POSE_Z]));
        const rotation still = turned_rotation(&r, joint);
        r.x = sum(times(c, still.x), times(s, still.y));
        r.y = difference(times(c, still.y), times(s, still.x));
        r.z = still.z;
        frames[i].axes = r;
        frames[i].origin = origin;
    }
}

INLINE void move_frames(const double *packed, int n, const lanes *dq, const lanes *ddq, frame *frames)
{
    vec3 origin = zero(), w = zero(), dw = zero(), a = constant(packed);
    for (int i = 0; i < n; i++) {
        frame *f = frames + i;
        const vec3 lever = difference(f->origin, origin);
        const vec3 z = f->axes.z;
        origin = f->origin;
        a = sum(a, sum(cross(dw, lever), cross(w, cross(w, lever))));
        dw = sum(dw, sum(times(ddq[i], z), times(dq[i], cross(w, z))));
        w = sum(w, times(dq[i], z));
        f->w = w;
        f->dw = dw;
        f->a = a;
    }
}

INLINE void gather_motion(const group *g, int n, int joints, const double *q, const double *dq, const double *ddq,
                          motion *m)
{
    for (int i = 0; i < joints; i++) {
        m->q[i] = gathered(g, q, n, i);
        m->dq[i] = gathered(g, dq, n, i);
        m->ddq[i] = gathered(g, ddq, n, i);
    }
}

INLINE void forward_pass(const double *packed, int joints, const motion *m, frame *frames)
{
    place_frames(packed, joints, m->q, frames);
    move_frames(packed, joints, m->dq, m->ddq, frames);
}

#endif
