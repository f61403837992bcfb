"""What a calibration is worth on motions that it was not made from.

Base parameters that one motion hardly shows can be anything along it, and a fit leaves little all the same: on er50 the
body from one run left half of joint 1's torque on another. The covariance knows that. It is asked on a motion of the
same range and speed in which the joints go out of step: each run's joints are moved in time against each other.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.calibration.arm_calibration import ArmCalibration
from armload_identification.calibration.arm_rows import RunSignals
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates

_SAMPLES: Final = 300


def doubtful_share(calibration: ArmCalibration, level: Chain, run: RunSignals) -> FloatArray:
    """By how much the torque of another motion may be predicted wrongly.

    Args:
        calibration: The arm.
        level: The arm under gravity as it pulls, `calibration.level`.
        run: A run whose range and speeds the other motion has.

    Returns:
        (n,) half width of the 95 % interval over the torque, RMS along the motion.
    """
    length, n = run.position_rad.shape
    step = max(length // _SAMPLES, 1)

    def out_of_step(values: FloatArray) -> FloatArray:
        moved = [np.roll(values[:, joint], joint * length // (n + 1)) for joint in range(n)]
        return np.ascontiguousarray(np.column_stack(moved)[::step])

    states = JointStates(*(out_of_step(x) for x in (run.position_rad, run.velocity_rad_s, run.acceleration_rad_s2)))
    torque = calibration.body.torque(level, *states)
    doubts = calibration.torque_doubts(level, states, step * run.interval_s, torque)
    size = np.sqrt(np.mean(np.sum(doubts**2, axis=0), axis=0))
    whole = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), np.finfo(float).tiny)
    return np.asarray(NORMAL_HALF_WIDTH * size / whole)
