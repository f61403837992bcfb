"""Uncertainty of a calibration on motions other than those of its runs.

Base parameters that one motion hardly excites can have any value without increasing its residual: on er50 the body from
one run left half of joint 1's torque unexplained in another. The covariance contains this. It is evaluated on motions
of the same range and speed with other combinations of positions: each run with its joints shifted in time relative to
each other.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.signals.motion import Motion

_SAMPLES: Final = 300


def doubtful_share(calibration: ArmCalibration, level: Chain, run: Motion) -> FloatArray:
    """Relative uncertainty of the predicted torque on another motion.

    Args:
        level: The arm with its tilt, `calibration.level`.
        run: A run with the range and speeds of the other motion.

    Returns:
        (n,) ratio of the half width of the 95 % interval to the torque, RMS along the motion.
    """
    length, n = run.states.position_rad.shape
    step = max(length // _SAMPLES, 1)

    def out_of_step(values: FloatArray) -> FloatArray:
        moved = [np.roll(values[:, joint], joint * length // (n + 1)) for joint in range(n)]
        return np.ascontiguousarray(np.column_stack(moved)[::step])

    states = JointStates(*map(out_of_step, run.states))
    torque = calibration.body.torque(level, *states)
    changes = calibration.torque_changes(level, states, step * run.interval_s, torque)
    doubts = np.tensordot(calibration.independent_errors, changes, axes=1)
    size = np.sqrt(np.mean(np.sum(doubts**2, axis=0), axis=0))
    whole = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), np.finfo(float).tiny)
    return np.asarray(NORMAL_HALF_WIDTH * size / whole)
