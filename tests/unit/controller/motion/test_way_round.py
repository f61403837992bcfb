"""The search for a way round, without an arm: its queries, its result, and when it gives up."""

import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.motion import way_round
from armload_controller.motion.paths import BlockedWay
from armload_controller.motion.way_round import find_way

MOST_STRETCHES, VIA_POINTS = 400, 120

LIMITS = load_robot("prbt").limits.motion
START, GOAL = 0.3 * LIMITS.position_min_rad, 0.3 * LIMITS.position_max_rad


class Asked:
    """Refuses segments, and records them.

    Args:
        blocked: Whether an obstacle lies between two configurations.
    """

    def __init__(self, blocked):
        self.blocked, self.stretches = blocked, []

    def __call__(self, begin_rad, end_rad):
        self.stretches.append((begin_rad, end_rad))
        return "touches something" if self.blocked(begin_rad, end_rad) else None


def straight(begin_rad, end_rad):
    return np.array_equal(begin_rad, START) and np.array_equal(end_rad, GOAL)


def test_the_way_round_ends_at_the_goal():
    way = find_way(START, GOAL, LIMITS, Asked(straight))
    assert len(way) > 1
    np.testing.assert_array_equal(way[-1], GOAL)


def test_via_points_are_within_the_joints_ranges_and_away_from_their_ends():
    """Since nothing is free but the start, all of them are checked."""
    asked = Asked(lambda begin_rad, end_rad: not np.array_equal(begin_rad, end_rad))
    with pytest.raises(BlockedWay, match="no path round it"):
        find_way(START, GOAL, LIMITS, asked)
    via = np.array([end for _, end in asked.stretches if not np.array_equal(end, START)])
    via = via[(via != GOAL).any(axis=1)]
    assert len(np.unique(via, axis=0)) == VIA_POINTS
    ranges = LIMITS.position_max_rad - LIMITS.position_min_rad
    assert np.all(via >= LIMITS.position_min_rad + 0.01 * ranges)
    assert np.all(via <= LIMITS.position_max_rad - 0.01 * ranges)


def test_a_search_without_an_end_gives_up():
    """One segment in ten is free and none to the goal: thousands remain to be tried."""

    def labyrinth(begin_rad, end_rad):
        if np.array_equal(begin_rad, end_rad):
            return False
        pair = sorted((begin_rad.tobytes(), end_rad.tobytes()))
        return np.array_equal(end_rad, GOAL) or zlib.crc32(b"".join(pair)) % 10 > 0

    asked = Asked(labyrinth)
    with pytest.raises(BlockedWay, match="segments over"):
        find_way(START, GOAL, LIMITS, asked)
    # The two ends, and the rest of the last way.
    assert MOST_STRETCHES <= len(asked.stretches) <= MOST_STRETCHES + 10


@pytest.mark.parametrize(
    ("end", "words"), [(START, "the arm, at its present position"), (GOAL, "the path, at its start")]
)
def test_an_end_that_is_not_free_is_named_and_no_way_is_looked_for(end, words):
    asked = Asked(lambda begin_rad, end_rad: straight(begin_rad, end_rad) or np.array_equal(end_rad, end))
    with pytest.raises(BlockedWay, match=f"{words}, touches something"):
        find_way(START, GOAL, LIMITS, asked)
    assert len(asked.stretches) <= 3


def test_the_way_is_the_fastest_over_one_via_point():
    """Where only the straight way is blocked, no second via point makes it faster."""
    none_free = Asked(lambda begin_rad, end_rad: not np.array_equal(begin_rad, end_rad))
    with pytest.raises(BlockedWay):
        find_way(START, GOAL, LIMITS, none_free)
    via = np.array([end for _, end in none_free.stretches if not np.isin(end, [START, GOAL]).all()])

    def time_s(begin_rad, end_rad):
        return np.max(np.abs(end_rad - begin_rad) / LIMITS.velocity_max_rad_s, axis=-1)

    over, goal = find_way(START, GOAL, LIMITS, Asked(straight))
    np.testing.assert_array_equal(goal, GOAL)
    fastest = (time_s(START, via) + time_s(via, GOAL)).min()
    assert time_s(START, over) + time_s(over, GOAL) == pytest.approx(fastest)


def test_half_of_the_via_points_are_near_the_straight_way_and_all_are_spread_evenly():
    none_free = Asked(lambda begin_rad, end_rad: not np.array_equal(begin_rad, end_rad))
    with pytest.raises(BlockedWay):
        find_way(START, GOAL, LIMITS, none_free)
    ends = [end for _, end in none_free.stretches]
    via = np.unique([end for end in ends if not np.isin(end, [START, GOAL]).all()], axis=0)
    near = (via > np.minimum(START, GOAL) - 0.81).all(axis=1) & (via < np.maximum(START, GOAL) + 0.81).all(axis=1)
    assert VIA_POINTS // 2 <= near.sum() <= VIA_POINTS // 2 + 5
    low, high = LIMITS.position_min_rad, LIMITS.position_max_rad
    share = (via[~near] - low) / (high - low)
    assert share.mean(axis=0) == pytest.approx(np.full(len(low), 0.5), abs=0.06)
    assert (np.histogram(share[:, 0], 4, (0.0, 1.0))[0] > 0.15 * len(share)).all()


def test_via_points_are_haltons():
    """Digits of 1, 2, 3, ... mirrored at the point, in a base of its own for every joint: the first 16 primes."""
    from fractions import Fraction

    expected = [(Fraction(1, 2), Fraction(1, 3)), (Fraction(1, 4), Fraction(2, 3)), (Fraction(3, 4), Fraction(1, 9))]
    expected += [(Fraction(1, 8), Fraction(4, 9)), (Fraction(5, 8), Fraction(7, 9)), (Fraction(3, 8), Fraction(2, 9))]
    np.testing.assert_allclose(way_round._halton(6, 2), np.array(expected, dtype=float))
    primes = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53]
    np.testing.assert_allclose(way_round._halton(1, 16)[0], 1.0 / np.array(primes))


def test_half_of_them_are_up_to_0_8_rad_outside_the_straight_way_and_all_2_percent_from_the_limits():
    limits = SimpleNamespace(position_min_rad=np.array([-2.0, -1.0]), position_max_rad=np.array([2.0, 1.0]))
    points = way_round._via_points(np.array([0.0, 0.5]), np.array([0.5, 0.0]), limits)
    assert points.shape == (120, 2)
    share = way_round._halton(60, 2)
    np.testing.assert_allclose(points[:60, 0], -0.8 + share[:, 0] * 2.1)
    np.testing.assert_allclose(points[:60, 1], -0.8 + share[:, 1] * (0.96 + 0.8))
    np.testing.assert_allclose(points[60:], [-1.92, -0.96] + share * [3.84, 1.92])


def test_the_shortest_way_is_dijkstras():
    far = np.inf
    time_s = np.array([[far, far, 1.0, 4.0], [far, far, 5.0, 1.5], [1.0, 5.0, far, 2.0], [4.0, 1.5, 2.0, far]])
    assert way_round._shortest(time_s) == [0, 2, 3, 1]
    time_s[2, 3] = time_s[3, 2] = 3.5
    assert way_round._shortest(time_s) == [0, 3, 1]
    time_s[3, 1] = 2.5
    assert way_round._shortest(time_s) == [0, 2, 1]
    time_s[2, 1] = time_s[3, 1] = far
    assert way_round._shortest(time_s) is None
