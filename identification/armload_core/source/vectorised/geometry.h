/* Vectors and rotations in space, for LANES samples at once. */

#ifndef ARMLOAD_GEOMETRY_H
#define ARMLOAD_GEOMETRY_H

#include "lanes.h"

typedef struct {
    lanes x, y, z;
} vec3;

/* A rotation matrix R by its columns: the frame's axes in outer coordinates. */
typedef struct {
    vec3 x, y, z;
} rotation;

/* A vector that does not depend on the sample. */
INLINE vec3 constant(const double *v)
{
    return (vec3){all(v[0]), all(v[1]), all(v[2])};
}

INLINE vec3 zero(void)
{
    return (vec3){all(0.0), all(0.0), all(0.0)};
}

INLINE vec3 sum(vec3 a, vec3 b)
{
    return (vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

INLINE vec3 difference(vec3 a, vec3 b)
{
    return (vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

INLINE vec3 times(lanes s, vec3 v)
{
    return (vec3){s * v.x, s * v.y, s * v.z};
}

INLINE lanes dot(vec3 a, vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

INLINE vec3 cross(vec3 a, vec3 b)
{
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* R v: from frame to outer coordinates. */
INLINE vec3 turned(const rotation *r, vec3 v)
{
    return sum(sum(times(v.x, r->x), times(v.y, r->y)), times(v.z, r->z));
}

/* R^T v: from outer to frame coordinates. */
INLINE vec3 turned_back(const rotation *r, vec3 v)
{
    return (vec3){dot(r->x, v), dot(r->y, v), dot(r->z, v)};
}

/* R v and R P for a constant vector v and a constant rotation P, stored row by row. */
INLINE vec3 turned_constant(const rotation *r, double x, double y, double z)
{
    return (vec3){
        r->x.x * x + r->y.x * y + r->z.x * z,
        r->x.y * x + r->y.y * y + r->z.y * z,
        r->x.z * x + r->y.z * y + r->z.z * z,
    };
}

INLINE rotation turned_rotation(const rotation *r, const double *p)
{
    return (rotation){
        turned_constant(r, p[0], p[3], p[6]),
        turned_constant(r, p[1], p[4], p[7]),
        turned_constant(r, p[2], p[5], p[8]),
    };
}

/* A symmetric tensor times a vector; elements xx, yy, zz, xy, xz, yz. */
INLINE vec3 tensor_times(const lanes *i, vec3 v)
{
    return (vec3){
        i[0] * v.x + i[3] * v.y + i[4] * v.z,
        i[3] * v.x + i[1] * v.y + i[5] * v.z,
        i[4] * v.x + i[5] * v.y + i[2] * v.z,
    };
}

#endif
