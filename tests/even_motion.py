"""An arm in lockstep at constant speed, for tests of events during motion."""

import numpy as np
import pytest

from armload_drivers.servos import JointCommand

ZERO = np.zeros(3)


def enabled(arm):
    arm.servos.connect()
    return arm.servos.enable().position_rad


def move(arm, start_rad, cycles, speed_rad_s=0.5, done=0):
    """Move all joints at constant speed; returns the last commanded position."""
    for cycle in range(done + 1, done + cycles + 1):
        target = start_rad + cycle * arm.arm.cycle_s * speed_rad_s
        arm.servos.exchange(JointCommand(target, ZERO, ZERO))
    return target


def move_until_error(arm, start_rad, kind, cycles=50):
    with pytest.raises(kind) as raised:
        move(arm, start_rad, cycles)
    return raised.value
