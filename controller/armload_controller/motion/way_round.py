"""A collision-free path between two configurations: straight, or through a few via points.

The straight path is tried first. If it is not free, the fastest path over a fixed set of configurations is searched
for; a segment is checked only when it is part of the fastest remaining path. The result is deterministic, and the
search ends after `MOST_STRETCHES` segments.

References:
    Bohlin, Kavraki, Path planning using lazy PRM, ICRA 2000.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from functools import cache
from itertools import pairwise

import numpy as np

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.paths import BlockedWay
from armload_identification.float_array import FloatArray

VIA_POINTS = 120
"""Number of via points; half of them near the straight path, half anywhere."""
MOST_STRETCHES = 400
"""Greatest number of straight segments that are checked."""
_NEAR_RAD = 0.8
"""Via points near the straight path are at most this far outside the box that it spans."""
_MARGIN_SHARE = 0.02
"""Distance of via points from a joint's limits, as a share of its range."""
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)


def find_way(
    start_rad: FloatArray,
    goal_rad: FloatArray,
    limits: MotionLimits,
    objection: Callable[[FloatArray, FloatArray], str | None],
) -> tuple[FloatArray, ...]:
    """Find a path of straight segments.

    Args:
        start_rad: (n,) present position of the arm.
        goal_rad: (n,) goal.
        limits: Limits of the joints.
        objection: Why the straight line between two configurations is not free; None if it is free.

    Returns:
        The ends of the segments; the last is the goal.

    Raises:
        BlockedWay: no path was found; the message states why the straight one is blocked.
    """
    straight = objection(start_rad, goal_rad)
    if straight is None:
        return (goal_rad,)
    for where, at in (("the arm, at its present position,", start_rad), ("the path, at its start,", goal_rad)):
        stands = objection(at, at)
        if stands is not None:
            raise BlockedWay(f"{where} {stands}")
    nodes = np.vstack([start_rad, goal_rad, _via_points(start_rad, goal_rad, limits)])
    time_s = (np.abs(nodes[:, None] - nodes[None]) / limits.velocity_max_rad_s).max(axis=2)
    time_s[0, 1] = time_s[1, 0] = np.inf
    checked = 1
    free: set[tuple[int, int]] = set()
    while checked < MOST_STRETCHES and (way := _shortest(time_s)) is not None:
        for a, b in pairwise(way):
            if (a, b) in free:
                continue
            checked += 1
            if objection(nodes[a], nodes[b]) is not None:
                time_s[a, b] = time_s[b, a] = np.inf
                break
            free |= {(a, b), (b, a)}
        else:
            return tuple(nodes[node] for node in way[1:])
    raise BlockedWay(
        f"the straight path {straight}; no path round it was found among {checked} segments over {VIA_POINTS} via "
        "points"
    )


def _shortest(time_s: FloatArray) -> list[int] | None:
    """Nodes of the fastest path from 0 to 1 by Dijkstra's method; None if there is none."""
    quickest = np.full(len(time_s), np.inf)
    quickest[0] = 0.0
    before = np.full(len(time_s), -1)
    waiting = [(0.0, 0)]
    while waiting:
        reached_s, node = heapq.heappop(waiting)
        if node == 1:
            way = [1]
            while way[-1] != 0:
                way.append(int(before[way[-1]]))
            return way[::-1]
        if reached_s > quickest[node]:
            continue
        later_s = reached_s + time_s[node]
        for better in np.flatnonzero(later_s < quickest):
            quickest[better], before[better] = later_s[better], node
            heapq.heappush(waiting, (float(later_s[better]), int(better)))
    return None


def _via_points(start_rad: FloatArray, goal_rad: FloatArray, limits: MotionLimits) -> FloatArray:
    """(V, n) configurations spread evenly, near the straight path and over the joints' ranges."""
    margin = _MARGIN_SHARE * (limits.position_max_rad - limits.position_min_rad)
    low, high = limits.position_min_rad + margin, limits.position_max_rad - margin
    near_low = np.clip(np.minimum(start_rad, goal_rad) - _NEAR_RAD, low, high)
    near_high = np.clip(np.maximum(start_rad, goal_rad) + _NEAR_RAD, low, high)
    share = _halton(VIA_POINTS // 2, len(start_rad))
    return np.vstack([near_low + share * (near_high - near_low), low + share * (high - low)])


@cache
def _halton(count: int, n: int) -> FloatArray:
    """(count, n) points of the Halton sequence in the unit cube."""
    points = np.zeros((count, n))
    for joint, base in enumerate(_PRIMES[:n]):
        for row in range(count):
            number, digit = row + 1, 1.0
            while number:
                number, rest = divmod(number, base)
                digit /= base
                points[row, joint] += rest * digit
    return points
