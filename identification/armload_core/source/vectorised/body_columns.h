/* The regressor of one body: ten columns per joint.

   Each row is the inner product of the joint's motion at the body and the body's momentum balance, in body coordinates:

       f = m a + A s,  A = [dw]x + [w]x [w]x                force from mass and first moment s
       n = s x a + I dw + w x (I w)                         moment about the body's origin
       tau_i = v_i . f + z_i . n                            z_i, v_i: the joint's axis and its velocity there

   Chen 2016, eqs. (4), (5). */

#ifndef ARMLOAD_BODY_COLUMNS_H
#define ARMLOAD_BODY_COLUMNS_H

#include <stddef.h>

#include "chain.h"
#include "frames.h"
#include "geometry.h"
#include "lanes.h"

/* Body fixed to joint `joints`. `placement` (rotation, row by row) and `position` place its frame in the turned joint
   frame; `position` is NULL if the two origins coincide. */
INLINE void body_columns(const frame *frames, int joints, const double *placement, const double *position,
                         lanes (*rows)[BODY_PARAMETERS])
{
    const frame *f = frames + joints - 1;
    const rotation r = turned_rotation(&f->axes, placement);
    vec3 origin = f->origin, acceleration = f->a;
    if (position) {
        const vec3 lever = turned_constant(&f->axes, position[0], position[1], position[2]);
        origin = sum(origin, lever);
        acceleration = sum(acceleration, sum(cross(f->dw, lever), cross(f->w, cross(f->w, lever))));
    }
    const vec3 w = turned_back(&r, f->w);
    const vec3 dw = turned_back(&r, f->dw);
    const vec3 a = turned_back(&r, acceleration);
    const lanes wxx = w.x * w.x, wyy = w.y * w.y, wzz = w.z * w.z;
    const lanes wxy = w.x * w.y, wxz = w.x * w.z, wyz = w.y * w.z;
    /* columns of A */
    const vec3 force_x = {-wyy - wzz, wxy + dw.z, wxz - dw.y};
    const vec3 force_y = {wxy - dw.z, -wxx - wzz, wyz + dw.x};
    const vec3 force_z = {wxz + dw.y, wyz - dw.x, -wxx - wyy};
    for (int i = 0; i < joints; i++) {
        const frame *g = frames + i;
        lanes *row = rows[i];
        const vec3 z = turned_back(&r, g->axes.z);
        const vec3 v = turned_back(&r, cross(g->axes.z, difference(origin, g->origin)));
        row[0] = dot(v, a);
        row[1] = dot(v, force_x) + z.z * a.y - z.y * a.z;
        row[2] = dot(v, force_y) + z.x * a.z - z.z * a.x;
        row[3] = dot(v, force_z) + z.y * a.x - z.x * a.y;
        row[4] = z.x * dw.x + z.y * wxz - z.z * wxy;
        row[5] = z.y * dw.y + z.z * wxy - z.x * wyz;
        row[6] = z.z * dw.z + z.x * wyz - z.y * wxz;
        row[7] = z.x * (dw.y - wxz) + z.y * (dw.x + wyz) + z.z * (wxx - wyy);
        row[8] = z.x * (dw.z + wxy) + z.y * (wzz - wxx) + z.z * (dw.x - wyz);
        row[9] = z.x * (wyy - wzz) + z.y * (dw.z - wxy) + z.z * (dw.y + wxz);
    }
}

INLINE void flange_columns(const double *packed, int n, const frame *frames, lanes (*rows)[BODY_PARAMETERS])
{
    const double *flange = flange_of(packed, n);
    body_columns(frames, n, flange, flange + POSE_X, rows);
}

#endif
