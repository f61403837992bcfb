"""The share of a calibrated arm's torque that is doubtful on another motion."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.calibration.other_motions import doubtful_share
from armload_identification.model.joint_states import JointStates

pytestmark = pytest.mark.pure

N = 2


class Calibration:
    """Torque is ten times the position, with two independent doubts of 3 % and 4 %."""

    def __init__(self):
        self.body = SimpleNamespace(torque=lambda level, position, velocity, acceleration: 10.0 * position)
        self.independent_errors = np.eye(2)
        self.seen = []

    def torque_changes(self, level, states, interval_s, torque):
        self.seen.append((states, interval_s))
        return np.stack([0.03 * torque, 0.04 * torque])


def run(rows):
    position = np.arange(1.0, rows + 1)[:, None] * np.ones(N)
    return SimpleNamespace(states=JointStates(position, 2.0 * position, 3.0 * position), interval_s=0.01)


@pytest.mark.parametrize(("rows", "step"), [(1, 1), (90, 1), (599, 1), (600, 2), (960, 3)])
def test_it_is_the_half_width_of_the_interval_on_joints_moved_against_each_other(rows, step):
    calibration = Calibration()
    np.testing.assert_allclose(doubtful_share(calibration, None, run(rows)), 1.959964 * 0.05, rtol=1e-6)
    ((states, interval_s),) = calibration.seen
    assert interval_s == pytest.approx(0.01 * step)
    first, second = states.position_rad.T
    np.testing.assert_array_equal(first, np.arange(1, rows + 1)[::step])
    shift = rows // 3
    np.testing.assert_array_equal(second, np.roll(np.arange(1, rows + 1), shift)[::step])
    np.testing.assert_array_equal(states.velocity_rad_s, 2.0 * states.position_rad)
    np.testing.assert_array_equal(states.acceleration_rad_s2, 3.0 * states.position_rad)
