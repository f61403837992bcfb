/* Distances of the spheres around the links from the surroundings and from each other. */

#ifndef ARMLOAD_CLEARANCE_H
#define ARMLOAD_CLEARANCE_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "chain.h"
#include "frames.h"
#include "geometry.h"
#include "instruction_sets/batch.h"
#include "lanes.h"

/* Aligned storage for `count` vectors; to be released with free(start). */
typedef struct {
    void *start;
    vec3 *at;
} vectors;

INLINE vectors new_vectors(ptrdiff_t count)
{
    vectors v = {malloc((size_t)count * sizeof(vec3) + sizeof(lanes)), NULL};
    if (v.start) {
        v.at = (vec3 *)(((uintptr_t)v.start + sizeof(lanes) - 1) & ~(uintptr_t)(sizeof(lanes) - 1));
    }
    return v;
}

INLINE ptrdiff_t clearance_count(const obstacles *o)
{
    return o->on_planes + o->on_boxes + o->pairs;
}

INLINE double radius_of(const obstacles *o, ptrdiff_t sphere)
{
    return o->sphere[SPHERE_NUMBERS * sphere + RADIUS];
}

INLINE void place_spheres(const obstacles *o, const frame *frames, vec3 *centres)
{
    for (ptrdiff_t s = 0; s < o->spheres; s++) {
        const double *c = o->sphere + SPHERE_NUMBERS * s;
        if (o->link[s] == 0) {
            centres[s] = constant(c);
        } else {
            const frame *f = frames + o->link[s] - 1;
            centres[s] = sum(f->origin, turned_constant(&f->axes, c[0], c[1], c[2]));
        }
    }
}

/* Signed distance of a point from a box, negative inside, and its gradient with respect to the point. */
INLINE lanes box_distance(const double *box, vec3 point, vec3 *gradient)
{
    const vec3 from_centre = difference(point, constant(box + BOX_CENTRE));
    lanes along[3], over[3], outside = all(0.0), deepest = all(-HUGE_VAL);
    for (int a = 0; a < 3; a++) {
        along[a] = box[a] * from_centre.x + box[3 + a] * from_centre.y + box[6 + a] * from_centre.z;
        const lanes beyond = magnitude(along[a]) - box[BOX_HALVES + a];
        over[a] = chosen(beyond > 0.0, beyond, all(0.0));
        outside += over[a] * over[a];
        deepest = chosen(beyond > deepest, beyond, deepest);
    }
    const lane_bits is_outside = outside > 0.0;
    const lanes far = square_root(outside);
    lane_bits found = outside < 0.0; /* false in every lane; among equally near sides the first is taken */
    *gradient = zero();
    for (int a = 0; a < 3; a++) {
        const lane_bits nearest = (magnitude(along[a]) - box[BOX_HALVES + a] == deepest) & ~found;
        const lanes inside_share = chosen(nearest, all(1.0), all(0.0));
        const lanes share = with_sign(chosen(is_outside, over[a] / far, inside_share), along[a]);
        found |= nearest;
        gradient->x += share * box[a];
        gradient->y += share * box[3 + a];
        gradient->z += share * box[6 + a];
    }
    return chosen(is_outside, far, deepest);
}

ENTRY int clearances(const double *packed, int n, const obstacles *o, ptrdiff_t samples, const double *q, double *out)
{
    const ptrdiff_t width = clearance_count(o);
    const vectors centres = new_vectors(o->spheres);
    if (!centres.at) {
        return -1;
    }
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        lanes angle[MOST_JOINTS];
        ptrdiff_t k = 0;
        for (int i = 0; i < n; i++) {
            angle[i] = gathered(&g, q, n, i);
        }
        place_frames(packed, n, angle, frames);
        place_spheres(o, frames, centres.at);
        for (ptrdiff_t i = 0; i < o->on_planes; i++, k++) {
            const int64_t s = o->on_plane[2 * i];
            const double *plane = o->plane + PLANE_NUMBERS * o->on_plane[2 * i + 1];
            const lanes distance = dot(constant(plane), centres.at[s]) - plane[DISTANCE] - radius_of(o, s);
            scattered(&g, &distance, 1, out, width, k);
        }
        for (ptrdiff_t i = 0; i < o->on_boxes; i++, k++) {
            const int64_t s = o->on_box[2 * i];
            vec3 gradient;
            const lanes distance = box_distance(o->box + BOX_NUMBERS * o->on_box[2 * i + 1], centres.at[s], &gradient)
                                   - radius_of(o, s);
            scattered(&g, &distance, 1, out, width, k);
        }
        for (ptrdiff_t i = 0; i < o->pairs; i++, k++) {
            const int64_t a = o->pair[2 * i], b = o->pair[2 * i + 1];
            const vec3 between = difference(centres.at[a], centres.at[b]);
            const lanes distance = square_root(dot(between, between)) - radius_of(o, a) - radius_of(o, b);
            scattered(&g, &distance, 1, out, width, k);
        }
    }
    free(centres.start);
    return 0;
}

/* The gradient of a clearance with respect to a sphere's centre p is a unit vector, and dp/dq_i = z_i x (p - o_i). */
ENTRY int clearance_slope(const double *packed, int n, const obstacles *o, const double *weight, ptrdiff_t samples,
                          const double *q, double *slope)
{
    const ptrdiff_t width = clearance_count(o);
    const vectors storage = new_vectors(2 * o->spheres);
    vec3 *centres = storage.at, *pull = storage.at + o->spheres;
    if (!storage.at) {
        return -1;
    }
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        lanes angle[MOST_JOINTS], by_q[MOST_JOINTS], weighty = all(0.0);
        ptrdiff_t k = 0;
        for (ptrdiff_t i = 0; i < width; i++) {
            weighty += magnitude(gathered(&g, weight, width, i));
        }
        if (!any(weighty != 0.0)) {
            continue;
        }
        for (int i = 0; i < n; i++) {
            angle[i] = gathered(&g, q, n, i);
            by_q[i] = all(0.0);
        }
        place_frames(packed, n, angle, frames);
        place_spheres(o, frames, centres);
        for (ptrdiff_t s = 0; s < o->spheres; s++) {
            pull[s] = zero();
        }
        for (ptrdiff_t i = 0; i < o->on_planes; i++, k++) {
            const int64_t s = o->on_plane[2 * i];
            const lanes share = gathered(&g, weight, width, k);
            pull[s] = sum(pull[s], times(share, constant(o->plane + PLANE_NUMBERS * o->on_plane[2 * i + 1])));
        }
        for (ptrdiff_t i = 0; i < o->on_boxes; i++, k++) {
            const lanes share = gathered(&g, weight, width, k);
            if (any(share != 0.0)) {
                const int64_t s = o->on_box[2 * i];
                vec3 gradient;
                box_distance(o->box + BOX_NUMBERS * o->on_box[2 * i + 1], centres[s], &gradient);
                pull[s] = sum(pull[s], times(share, gradient));
            }
        }
        for (ptrdiff_t i = 0; i < o->pairs; i++, k++) {
            const lanes share = gathered(&g, weight, width, k);
            if (any(share != 0.0)) {
                const int64_t a = o->pair[2 * i], b = o->pair[2 * i + 1];
                const vec3 between = difference(centres[a], centres[b]);
                const lanes distance = square_root(dot(between, between));
                const vec3 force = times(chosen(distance > 0.0, share / distance, all(0.0)), between);
                pull[a] = sum(pull[a], force);
                pull[b] = difference(pull[b], force);
            }
        }
        for (ptrdiff_t s = 0; s < o->spheres; s++) {
            if (any((pull[s].x != 0.0) | (pull[s].y != 0.0) | (pull[s].z != 0.0))) {
                for (int i = 0; i < o->link[s]; i++) {
                    const vec3 lever = difference(centres[s], frames[i].origin);
                    by_q[i] += dot(frames[i].axes.z, cross(lever, pull[s]));
                }
            }
        }
        scattered(&g, by_q, n, slope, n, 0);
    }
    free(storage.start);
    return 0;
}

#endif
