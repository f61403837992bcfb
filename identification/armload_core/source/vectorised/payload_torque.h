/* Torque of a payload for one state: the feed-forward's kernel.

       tau = J(q)^T w(q, dq, ddq, theta)                    Chen 2016, eq. (2)

   Recursive Newton-Euler in link coordinates: velocities and accelerations outwards, force and moment of the payload at
   the flange, and the wrench inwards. The sines of all joints are computed in vectors and the rotations beforehand,
   because each operation of the recursion depends on the one before. */

#ifndef ARMLOAD_PAYLOAD_TORQUE_H
#define ARMLOAD_PAYLOAD_TORQUE_H

#include "chain.h"
#include "lanes.h"

/* A vector and its operations as in `geometry.h`, for a single state. */
typedef struct {
    double x, y, z;
} vec1;

INLINE vec1 sum1(vec1 a, vec1 b)
{
    return (vec1){a.x + b.x, a.y + b.y, a.z + b.z};
}

INLINE vec1 times1(double s, vec1 v)
{
    return (vec1){s * v.x, s * v.y, s * v.z};
}

INLINE vec1 cross1(vec1 a, vec1 b)
{
    return (vec1){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

INLINE vec1 tensor_times1(const double *i, vec1 v)
{
    return (vec1){
        i[0] * v.x + i[3] * v.y + i[4] * v.z,
        i[3] * v.x + i[1] * v.y + i[5] * v.z,
        i[4] * v.x + i[5] * v.y + i[2] * v.z,
    };
}

/* Pose of a frame in the previous one, in the layout of the packed array: rotation (row by row), position. */
typedef struct {
    double r[ROTATION_NUMBERS];
    vec1 lever;
} pose1;

INLINE vec1 turned1(const pose1 *p, vec1 v)
{
    const double *r = p->r;
    return (vec1){
        r[0] * v.x + r[1] * v.y + r[2] * v.z,
        r[3] * v.x + r[4] * v.y + r[5] * v.z,
        r[6] * v.x + r[7] * v.y + r[8] * v.z,
    };
}

INLINE vec1 turned_back1(const pose1 *p, vec1 v)
{
    const double *r = p->r;
    return (vec1){
        r[0] * v.x + r[3] * v.y + r[6] * v.z,
        r[1] * v.x + r[4] * v.y + r[7] * v.z,
        r[2] * v.x + r[5] * v.y + r[8] * v.z,
    };
}

/* The pose p (rotation row by row, position) followed by Rz(angle), with the angle's cosine c and sine s. */
INLINE pose1 pose_of(const double *p, double c, double s)
{
    pose1 pose = {.lever = {p[POSE_X], p[POSE_Y], p[POSE_Z]}};
    for (int k = 0; k < ROTATION_NUMBERS; k += VECTOR_NUMBERS) {
        pose.r[k] = c * p[k] + s * p[k + 1];
        pose.r[k + 1] = c * p[k + 1] - s * p[k];
        pose.r[k + 2] = p[k + 2];
    }
    return pose;
}

typedef struct {
    vec1 w, dw, a;
} motion1;

/* Motion of a frame at pose p in a moving frame and fixed to it, in the new frame's coordinates. */
INLINE motion1 carried(const motion1 *m, const pose1 *p)
{
    const vec1 a = sum1(m->a, sum1(cross1(m->dw, p->lever), cross1(m->w, cross1(m->w, p->lever))));
    return (motion1){turned_back1(p, m->w), turned_back1(p, m->dw), turned_back1(p, a)};
}

ENTRY void payload_torque(const double *model, int n, const double *q, const double *dq, const double *ddq,
                          double *torque)
{
    const pose1 flange = pose_of(flange_of(model, n), 1.0, 0.0);
    const double *body = model + packed_length(n), mass = body[0], *inertia = body + 4;
    const vec1 first = {body[1], body[2], body[3]};
    pose1 pose[MOST_JOINTS];
    motion1 m = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {model[0], model[1], model[2]}};
    for (int i = 0; i < n; i += LANES) {
        const group g = group_at(i, n);
        lanes s, c;
        sine_cosine(gathered(&g, q, 1, 0), &s, &c);
        for (int l = 0; l < g.used; l++) {
            pose[i + l] = pose_of(joint_of(model, i + l), c[l], s[l]);
        }
    }
    for (int i = 0; i < n; i++) {
        m = carried(&m, pose + i);
        m.dw.x += m.w.y * dq[i];
        m.dw.y -= m.w.x * dq[i];
        m.dw.z += ddq[i];
        m.w.z += dq[i];
    }
    m = carried(&m, &flange);
    vec1 force = sum1(times1(mass, m.a), sum1(cross1(m.dw, first), cross1(m.w, cross1(m.w, first))));
    vec1 moment =
        sum1(sum1(tensor_times1(inertia, m.dw), cross1(m.w, tensor_times1(inertia, m.w))), cross1(first, m.a));
    const pose1 *outer = &flange;
    for (int i = n - 1; i >= 0; i--) {
        force = turned1(outer, force);
        moment = sum1(turned1(outer, moment), cross1(outer->lever, force));
        torque[i] = moment.z;
        outer = pose + i;
    }
}

#endif
