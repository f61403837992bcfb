"""Distances of the spheres around an arm's links from what they must not touch: numba kernels.

The kernels keep the rules of `kernels`. A sphere is a link (0 the base, i the one that turns with joint i), a
centre in that link's turned frame and a radius. A clearance is one of three: sphere and half-space, sphere and
box, sphere and sphere, in this order in every row.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from armload_identification.model.kernels import FRAME_NUMBERS, forward_into

BOX_NUMBERS = 15
"""A box in numbers: rotation of its axes 9, centre 3, half of its edges 3."""


@numba.njit("void(float64[:, ::1], int64[::1], float64[:, ::1], float64[:, ::1])", cache=True, fastmath={"contract"})
def _place_into(frames, links, spheres, centres):  # type: ignore[no-untyped-def]
    """Centres of all spheres in base coordinates, into centres (S, 3)."""
    for s in range(links.shape[0]):
        x, y, z = spheres[s, 0], spheres[s, 1], spheres[s, 2]
        if links[s] == 0:
            centres[s, 0], centres[s, 1], centres[s, 2] = x, y, z
        else:
            f = frames[links[s] - 1]
            centres[s, 0] = f[9] + f[0] * x + f[1] * y + f[2] * z
            centres[s, 1] = f[10] + f[3] * x + f[4] * y + f[5] * z
            centres[s, 2] = f[11] + f[6] * x + f[7] * y + f[8] * z


@numba.njit("float64(float64[::1], float64[::1], float64[::1])", cache=True, fastmath={"contract"})
def _box_distance(box, point, direction):  # type: ignore[no-untyped-def]
    """Signed distance of a point from a box, negative inside; its gradient by the point into direction (3,)."""
    dx, dy, dz = point[0] - box[9], point[1] - box[10], point[2] - box[11]
    outside, deepest, nearest = 0.0, -1e300, 0
    for a in range(3):
        along = box[a] * dx + box[3 + a] * dy + box[6 + a] * dz
        beyond = abs(along) - box[12 + a]
        if beyond > 0.0:
            outside += beyond * beyond
        if beyond > deepest:
            deepest, nearest = beyond, a
    direction[:] = 0.0
    if outside == 0.0:
        side = 1.0 if box[nearest] * dx + box[3 + nearest] * dy + box[6 + nearest] * dz >= 0.0 else -1.0
        for c in range(3):
            direction[c] = side * box[3 * c + nearest]
        return deepest
    distance = math.sqrt(outside)
    for a in range(3):
        along = box[a] * dx + box[3 + a] * dy + box[6 + a] * dz
        beyond = abs(along) - box[12 + a]
        if beyond > 0.0:
            share = beyond / distance if along >= 0.0 else -beyond / distance
            for c in range(3):
                direction[c] += share * box[3 * c + a]
    return distance


@numba.njit(
    "void(float64[::1], int64, int64[::1], float64[:, ::1], float64[:, ::1], int64[:, ::1], float64[:, ::1],"
    " int64[:, ::1], int64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def clearances_into(packed, n, links, spheres, planes, on_plane, boxes, on_box, pairs, q, out):  # type: ignore[no-untyped-def]
    """All clearances in m per configuration q (N, n), into out (N, K).

    `on_plane` and `on_box` are (., 2) sphere and obstacle, `pairs` (., 2) spheres; planes (., 4) are a unit
    normal that points to where the arm may be, and the plane's distance from the origin along it.
    """
    frames = np.empty((n, FRAME_NUMBERS))
    still = np.zeros(n)
    centres = np.empty((links.shape[0], 3))
    direction = np.empty(3)
    for t in range(q.shape[0]):
        forward_into(packed, n, q[t], still, still, frames)
        _place_into(frames, links, spheres, centres)
        row = out[t]
        k = 0
        for i in range(on_plane.shape[0]):
            c, p = centres[on_plane[i, 0]], planes[on_plane[i, 1]]
            row[k] = p[0] * c[0] + p[1] * c[1] + p[2] * c[2] - p[3] - spheres[on_plane[i, 0], 3]
            k += 1
        for i in range(on_box.shape[0]):
            distance = _box_distance(boxes[on_box[i, 1]], centres[on_box[i, 0]], direction)
            row[k] = distance - spheres[on_box[i, 0], 3]
            k += 1
        for i in range(pairs.shape[0]):
            a, b = centres[pairs[i, 0]], centres[pairs[i, 1]]
            x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
            row[k] = math.sqrt(x * x + y * y + z * z) - spheres[pairs[i, 0], 3] - spheres[pairs[i, 1], 3]
            k += 1


@numba.njit(
    "void(float64[::1], int64, int64[::1], float64[:, ::1], float64[:, ::1], int64[:, ::1], float64[:, ::1],"
    " int64[:, ::1], int64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])",
    cache=True,
    fastmath={"contract"},
    nogil=True,
)
def slope_into(packed, n, links, spheres, planes, on_plane, boxes, on_box, pairs, weight, q, slope):  # type: ignore[no-untyped-def]
    """Derivative of the sum of weight (N, K) times clearance by q, into zeroed slope (N, n).

    A clearance's gradient by a sphere's centre is a unit vector g; joint i moves the centre by z_i x (p - o_i).
    """
    frames = np.empty((n, FRAME_NUMBERS))
    still = np.zeros(n)
    centres = np.empty((links.shape[0], 3))
    pull = np.empty((links.shape[0], 3))
    direction = np.empty(3)
    for t in range(q.shape[0]):
        w = weight[t]
        used = False
        for k in range(w.shape[0]):
            used = used or w[k] != 0.0
        if not used:
            continue
        forward_into(packed, n, q[t], still, still, frames)
        _place_into(frames, links, spheres, centres)
        pull[:] = 0.0
        k = 0
        for i in range(on_plane.shape[0]):
            for c in range(3):
                pull[on_plane[i, 0], c] += w[k] * planes[on_plane[i, 1], c]
            k += 1
        for i in range(on_box.shape[0]):
            if w[k] != 0.0:
                _box_distance(boxes[on_box[i, 1]], centres[on_box[i, 0]], direction)
                for c in range(3):
                    pull[on_box[i, 0], c] += w[k] * direction[c]
            k += 1
        for i in range(pairs.shape[0]):
            if w[k] != 0.0:
                a, b = centres[pairs[i, 0]], centres[pairs[i, 1]]
                x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
                distance = math.sqrt(x * x + y * y + z * z)
                if distance > 0.0:
                    direction[0], direction[1], direction[2] = x / distance, y / distance, z / distance
                    for c in range(3):
                        pull[pairs[i, 0], c] += w[k] * direction[c]
                        pull[pairs[i, 1], c] -= w[k] * direction[c]
            k += 1
        for s in range(links.shape[0]):
            gx, gy, gz = pull[s, 0], pull[s, 1], pull[s, 2]
            if gx == 0.0 and gy == 0.0 and gz == 0.0:
                continue
            for i in range(links[s]):
                f = frames[i]
                x, y, z = centres[s, 0] - f[9], centres[s, 1] - f[10], centres[s, 2] - f[11]
                slope[t, i] += f[2] * (y * gz - z * gy) + f[5] * (z * gx - x * gz) + f[8] * (x * gy - y * gx)
