"""A way between two configurations that does not touch anything: straight, or by a few via points.

The straight way is tried first. Where it is not free, the shortest of the ways over a fixed set of configurations is
looked for, and a stretch is checked only when it is part of the shortest way left. What is found depends on nothing
but the question, and after `MOST_STRETCHES` stretches no further way is looked for.

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
from armload_core.arrays import FloatArray

VIA_POINTS = 120
"""Configurations that a way may lead over; half of them near the straight way, half anywhere."""
MOST_STRETCHES = 400
"""After so many straight stretches no further way is looked for."""
_NEAR_RAD = 0.8
"""Configurations near the straight way are at most this far outside the box that it spans."""
_MARGIN_SHARE = 0.02
"""Share of a joint's range that via points stay away from its ends."""
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)


def find_way(
    start_rad: FloatArray,
    goal_rad: FloatArray,
    limits: MotionLimits,
    objection: Callable[[FloatArray, FloatArray], str | None],
) -> tuple[FloatArray, ...]:
    """Where to go, one straight stretch after the other.

    Args:
        start_rad: (n,) where the arm stands.
        goal_rad: (n,) where it is to go.
        limits: Of the joints.
        objection: What speaks against the straight way between two configurations; None where nothing does.

    Returns:
        The ends of the stretches; the last is the goal.

    Raises:
        BlockedWay: no way was found; with what speaks against the straight one.
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
    """Nodes of the quickest way from 0 to 1 by Dijkstra's method; None where there is none."""
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
    """(V, n) configurations spread evenly, near the straight way and all over the joints' ranges."""
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
