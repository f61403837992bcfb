"""The smoothed sign of a speed, by which friction turns with the direction of motion."""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray


def smooth_sign(dq: FloatArray, reversal_speed_rad_s: FloatArray) -> FloatArray:
    """Direction of motion, tanh(dq / v): -1 to 1, and 0 at standstill.

    Args:
        dq: (N, n) velocities in rad/s.
        reversal_speed_rad_s: (n,) v.
    """
    return np.asarray(np.tanh(dq / reversal_speed_rad_s))
