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
