"""The shortest motion about a configuration, with a prospect and limits that are known by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import ExcitationError
from armload_identification.pipeline.wiggle import WiggleSearch

pytestmark = pytest.mark.pure

AT_RAD = np.array([0.5, -0.3])


class Prospect:
    """A half width of 1 kg / sqrt(time in s), which does not depend on the shape, or is `of_shape`."""

    def __init__(self, of_shape=None) -> None:
        self.of_shape, self.judged = of_shape, []

    def half_widths_kg(self, trajectory, counts):
        if counts.size == 1:
            self.judged.append((trajectory, float(counts[0])))
        if self.of_shape is not None:
            return np.full(counts.size, self.of_shape(trajectory))
        return 1.0 / np.sqrt(counts * trajectory.period_s)


def limits(worst=lambda _: np.array([-1.0]), excess=lambda _: np.array([-1.0]), reach_rad=0.1, speed=1e3):
    """Ranges that reach from the configuration 0.2 rad downwards and less upwards, and other limits far away."""
    joints = SimpleNamespace(
        position_min_rad=AT_RAD - 0.2,
        position_max_rad=AT_RAD + reach_rad,
        velocity_max_rad_s=np.full(2, speed),
        acceleration_max_rad_s2=np.full(2, 1e5),
        jerk_max_rad_s3=np.full(2, 1e7),
    )
    return SimpleNamespace(joints=joints, worst=worst, excess=excess)


def shortest(wanted_kg=0.75, prospect=None, envelope=None, step_s=0.5, objection=lambda _: None, seed=3):
    search = WiggleSearch((prospect or Prospect()).half_widths_kg, envelope or limits(), AT_RAD, step_s, objection)
    told: list[tuple[int, int]] = []
    return search.shortest(wanted_kg, seed, lambda *done: told.append(done)), told


def test_of_all_periods_that_of_the_shortest_motion_is_chosen():
    """16 s determine 0.25 kg: eight periods of 2 s; six of 3 s last longer, and two of 8 s as long."""
    found, told = shortest(0.25)
    assert (found.trajectory.period_s, found.periods, found.lasts_s) == pytest.approx((2.0, 8, 16.0))
    assert (found.half_width_kg, found.seed, found.tried) == (pytest.approx(0.25), 3, 180)
    assert told == [(0, 5), (1, 5), (2, 5), (3, 5), (4, 5), (5, 5)]
    assert shortest(0.2499)[0].periods == 9
    np.testing.assert_allclose(found.trajectory.offset_rad, AT_RAD)
    again, other = shortest(0.9)[0].trajectory, shortest(0.9, seed=4)[0].trajectory
    assert np.array_equal(again.sin_rad, found.trajectory.sin_rad)
    assert not np.allclose(other.sin_rad, found.trajectory.sin_rad)


def test_a_motion_that_must_not_be_driven_is_not_chosen():
    found, _ = shortest(0.25, objection=lambda motion: "it hits" if motion.period_s < 3.5 else None)
    assert (found.trajectory.period_s, found.periods) == (pytest.approx(4.0), 4)
    with pytest.raises(ExcitationError, match=r"respects all limits; it hits\. Choose another position or a smaller"):
        shortest(objection=lambda _: "it hits")


def test_longer_periods_are_not_tried_once_a_motion_is_shorter():
    tried = []
    found, told = shortest(0.6, objection=lambda motion: tried.append(motion.period_s))
    assert (found.lasts_s, tried) == (pytest.approx(3.0), pytest.approx([2.0, 3.0]))
    assert len(told) == 6


def test_of_a_minute_that_does_not_suffice_the_best_half_width_is_told():
    with pytest.raises(ExcitationError, match=r"at most 60 s .* to 0\.1 kg \(95 %\); the best one .* to 0\.129 kg"):
        shortest(wanted_kg=0.1)
    assert shortest(wanted_kg=60.0**-0.5)[0].lasts_s == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("step_s", "period_s", "harmonics", "judged"),
    [(0.7, 2.1, 3, 5), (2.0, 2.0, 2, 5), (3.0, 3.0, 4, 3), (20.0, 20.0, 6, 1), (0.3, 2.1, 3, 5), (5.0, 5.0, 6, 2)],
)
def test_a_period_is_a_multiple_of_the_step_and_its_harmonics_reach_1_2_hz(step_s, period_s, harmonics, judged):
    """Six harmonics at most; shapes are compared over whole periods of about 10 s."""
    prospect = Prospect()
    found, _ = shortest(wanted_kg=0.7, prospect=prospect, step_s=step_s)
    assert found.trajectory.period_s == pytest.approx(period_s)
    assert found.trajectory.harmonics == harmonics
    assert prospect.judged[0][1] == judged


def test_the_nearest_limit_sets_the_amplitude_of_each_joint():
    for envelope, order, size in (
        (limits(), 0, 0.098),
        (limits(reach_rad=0.3), 0, 0.196),
        (limits(speed=0.2), 1, 0.196),
    ):
        found = shortest(envelope=envelope)[0].trajectory
        states = np.stack(found.evaluate(np.arange(96) * (found.period_s / 96)))
        states[0] -= AT_RAD
        np.testing.assert_allclose(np.abs(states[order]).max(axis=0), size, rtol=1e-9)


def test_the_shape_with_the_least_half_width_wins_and_variations_of_it_are_better():
    prospect = Prospect(lambda motion: 1.0 - float(motion.sin_rad[0, 0]))
    found = shortest(wanted_kg=2.0, prospect=prospect)[0]
    widths = [prospect.of_shape(motion) for motion, _ in prospect.judged]
    assert len(widths) == 180
    assert prospect.of_shape(found.trajectory) == min(widths)
    assert min(widths[60:]) < min(widths[:60])
    assert np.median(widths[60:]) < np.quantile(widths[:60], 0.2), "near the best one"


def test_a_shape_that_exceeds_a_limit_becomes_smaller_four_times():
    """To 0.9 cubed, 72.9 %: of the amplitude of 0.098 rad 0.0714 rad."""

    def excess_over(limit_rad):
        return lambda states: np.abs(states[0] - AT_RAD).max(keepdims=True) - limit_rad

    found = shortest(envelope=limits(excess=excess_over(0.0715)))[0].trajectory
    motion = found.evaluate(np.arange(96) * (found.period_s / 96)).position_rad - AT_RAD
    np.testing.assert_allclose(np.abs(motion).max(axis=0), 0.098 * 0.729)
    with pytest.raises(ExcitationError, match=r"respects all limits\. Choose"):
        shortest(envelope=limits(excess=excess_over(0.071)))


def test_the_best_shape_becomes_smaller_until_the_limits_hold_between_samples():
    """By 2 % at most 25 times: to 60.3 %."""
    whole = shortest()[0].trajectory.sin_rad

    def worst_over(share):
        return lambda motion: np.array([np.abs(motion.sin_rad[0, 0] / whole[0, 0]) - share])

    assert np.allclose(shortest(envelope=limits(worst_over(1.001)))[0].trajectory.sin_rad, whole)
    found = shortest(envelope=limits(worst_over(0.65)))[0].trajectory
    np.testing.assert_allclose(found.sin_rad, 0.98**22 * whole)
    np.testing.assert_allclose(
        shortest(envelope=limits(worst_over(0.604)))[0].trajectory.sin_rad, 0.98**25 * whole, rtol=1e-9
    )
    with pytest.raises(ExcitationError, match="respects all limits"):
        shortest(envelope=limits(lambda _: np.array([0.1])), step_s=20.0)
