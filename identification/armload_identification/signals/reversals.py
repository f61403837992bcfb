"""Reversals of a joint: weights of samples near them, and the speed that smooths the direction of motion."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.signals.signal_constants import Reversal, Standstill

TURN_OVER: Final = Reversal.direction_share
"""For the rooms above, as the next one."""
REVERSAL: Final = Reversal.weight_share


def moving_joints(position_rad: FloatArray) -> NDArray[np.bool_]:
    """(n,) False for joints at rest, by their (N, n) positions.

    Static friction carries any part of their torque, and their servos' reaction to vibrations is no friction: on er50,
    whose wrist alone moved, 3 kg were found as 9.3 +- 0.2 kg from the joints at rest.
    """
    return np.asarray(np.ptp(position_rad, axis=0) > Standstill.travel_rad)


def reversal_weights(position_rad: FloatArray, velocity_rad_s: FloatArray, share: float = REVERSAL) -> FloatArray:
    """Weights that exclude joints at rest, and reversals, as `moving_weights`, v a small share of the greatest speed.

    Near a reversal no friction model is accurate, because of presliding, backlash and ripple.

    Args:
        position_rad: (N, n).
        velocity_rad_s: (N, n).
        share: v as a share of each joint's greatest speed.

    Returns:
        (N, n) factors on the rows of the whitened system, 0 to 1.
    """
    peak = np.maximum(np.abs(velocity_rad_s).max(axis=0), Standstill.slowest_rad_s)
    return np.asarray(np.where(moving_joints(position_rad), moving_weights(velocity_rad_s, share * peak), 0.0))


def moving_weights(velocity_rad_s: FloatArray, slow_rad_s: FloatArray) -> FloatArray:
    """(N, n) weights that exclude reversals and standstill: x / sqrt(1 + x^2), x = (dq / v)^2, v (n,) rad/s."""
    ratio = (velocity_rad_s / slow_rad_s) ** 2
    return np.asarray(ratio / np.sqrt(1.0 + ratio**2), dtype=np.float64)


def reversal_speed(velocity_rad_s: FloatArray) -> FloatArray:
    """(n,) speed in rad/s that smooths the direction of motion, from each joint's greatest speed in (N, n) rad/s."""
    return np.asarray(np.maximum(TURN_OVER * np.abs(velocity_rad_s).max(axis=0), Standstill.slowest_rad_s))
