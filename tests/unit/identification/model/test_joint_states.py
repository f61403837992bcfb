"""Joint states a short time earlier, against motions whose derivatives are known."""

import numpy as np
import pytest

from armload_identification.model.joint_states import JointStates

pytestmark = pytest.mark.pure

INTERVAL_S = 1e-3
TIME_S = INTERVAL_S * np.arange(400)
RATE = np.array([3.0, 5.0])


def states(time_s):
    phase = np.outer(time_s, RATE) + np.array([0.2, 1.0])
    return JointStates(np.sin(phase), RATE * np.cos(phase), -(RATE**2) * np.sin(phase))


@pytest.mark.parametrize("by_s", [2e-3, -2e-3])
def test_earlier_states_are_those_of_the_motion(by_s):
    found, truth = states(TIME_S).earlier(by_s, INTERVAL_S), states(TIME_S - by_s)
    inner = slice(1, -1)
    third, fourth = RATE**3, RATE**4
    for values, expected, error in zip(
        found, truth, (third * abs(by_s) ** 3 / 6, fourth * abs(by_s) ** 3 / 6, fourth * by_s**2 / 2), strict=True
    ):
        assert (np.abs(values - expected)[inner] < 1.5 * error + 1e-6 * abs(by_s)).all()
    assert np.abs(found.acceleration_rad_s2 - truth.acceleration_rad_s2)[inner].max() > 1e-5, "not exact: first order"


def test_at_the_same_time_they_are_the_same():
    for values, same in zip(states(TIME_S).earlier(0.0, INTERVAL_S), states(TIME_S), strict=True):
        np.testing.assert_array_equal(values, same)
