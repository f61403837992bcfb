"""A motion's period is found if there is one."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.signals.repetition import repeated_after

pytestmark = pytest.mark.pure


@pytest.mark.parametrize("period_s", [1.7, 5.0, 12.3])
@pytest.mark.parametrize("noise_rad", [0.0, 1e-3])
def test_a_period_is_found(pinocchio_arm, period_s, noise_rad):
    rng = np.random.default_rng(4)
    time_s = np.sort(rng.uniform(0.0, 2.6 * period_s, 3000))
    position = pinocchio_arm.trajectory(period_s=period_s).evaluate(time_s).position_rad
    found = repeated_after(time_s, position + noise_rad * rng.normal(size=position.shape))
    assert found == pytest.approx(period_s, rel=2e-3)


def test_what_does_not_repeat_itself_has_none(pinocchio_arm):
    time_s = 0.01 * np.arange(1500)
    position = pinocchio_arm.trajectory(period_s=10.0).evaluate(time_s).position_rad
    assert repeated_after(time_s, position) is None
    assert repeated_after(time_s, np.column_stack([time_s, time_s**2])) is None
    assert repeated_after(time_s, np.ones((1500, 2))) is None
    assert repeated_after(time_s[:10], position[:10]) is None


def test_joints_that_hardly_move_do_not_hide_a_period(pinocchio_arm):
    """Their drift within a hundredth of a radian is as large as the motion of the others after normalisation."""
    time_s = 0.01 * np.arange(1500)
    position = pinocchio_arm.trajectory(period_s=5.0).evaluate(time_s).position_rad
    position[:, 0] = np.linspace(0.0, 0.005, time_s.size)
    assert repeated_after(time_s, position) == pytest.approx(5.0, rel=2e-3)
    position[:, 0] *= 10.0
    assert repeated_after(time_s, position) is None


def test_a_cycle_that_differs_a_little_each_time_is_no_repetition():
    time_s = 0.01 * np.arange(2000)
    cycle = np.sin(2.0 * np.pi * time_s / 4.0)
    other = np.where(time_s < 4.0, 0.0, 0.3) * np.sin(6.0 * np.pi * time_s / 4.0)
    assert repeated_after(time_s, cycle[:, None]) == pytest.approx(4.0, rel=2e-3)
    assert repeated_after(time_s[:900], (cycle + other)[:900, None]) is None


def test_the_shortest_of_several_periods_is_given_and_not_its_multiples():
    time_s = 0.01 * np.arange(3000)
    position = np.column_stack([np.sin(2.0 * np.pi * time_s / 3.0), np.cos(4.0 * np.pi * time_s / 3.0)])
    assert repeated_after(time_s, position) == pytest.approx(3.0, rel=2e-3)
