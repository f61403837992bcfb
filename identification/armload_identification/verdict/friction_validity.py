"""Is a recording's friction still that of the calibrated arm?

A gear's friction drifts as it warms up, and a calibration knows by how much it did from run to run. What a recording
leaves of the arm's own torque is fitted with changes of Coulomb and viscous friction and of the offset, expected to be
of that size. A change far beyond it says that the calibration no longer holds: a cold arm, another lubricant, a worn
gear, or another gain.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.model.body_model import smooth_sign

FAR: Final = 5.0
"""Standard deviations of the drift between runs."""
_INDEPENDENT_HZ: Final = 2.0
"""Residuals of moving joints are alike for about half a second."""
_REVERSAL: Final = 0.10
"""Below this share of a joint's greatest speed friction is what no model says."""


def friction_change(
    arm: KnownArm, velocity_rad_s: FloatArray, left_nm: FloatArray, used: NDArray[np.bool_], interval_s: float
) -> FloatArray:
    """By how much friction differs from that of the calibration's runs.

    Args:
        arm: The calibrated arm.
        velocity_rad_s: (K, n) of a run.
        left_nm: (K, n) its torque less that of the calibrated arm, payload and friction included.
        used: (K,) which samples count.
        interval_s: Time between them.

    Returns:
        (3, n) Coulomb and viscous friction and offset, in standard deviations of their drift between runs.
    """
    direction = smooth_sign(velocity_rad_s, arm.fit.model.reversal_speed_rad_s)
    moving = np.abs(velocity_rad_s) > _REVERSAL * np.abs(velocity_rad_s).max(axis=0)
    weight = _INDEPENDENT_HZ * interval_s / np.maximum(arm.fit.residual_rms_nm, np.finfo(float).tiny) ** 2
    found = np.zeros((3, left_nm.shape[1]))
    for joint in range(found.shape[1]):
        rows = used & moving[:, joint]
        columns = np.stack([direction[rows, joint], velocity_rad_s[rows, joint], np.ones(np.count_nonzero(rows))], 1)
        columns = columns * arm.drift[:, joint]
        information = np.eye(3) + weight[joint] * columns.T @ columns
        found[:, joint] = np.linalg.solve(information, weight[joint] * columns.T @ left_nm[rows, joint])
    return found


def friction_notes(change: FloatArray) -> tuple[str, ...]:
    """What the operator should know of it.

    Args:
        change: (n,) standard deviations of the drift: of Coulomb or viscous friction, whichever is more, or of both.
    """
    far = np.flatnonzero(change > FAR)
    if not far.size:
        return ()
    joints = ", ".join(f"{joint + 1} ({change[joint]:.0f} standard deviations)" for joint in far)
    return (
        f"The friction of joint {joints} is far outside its variation in the calibration: a cold arm, a different "
        "lubricant, or a changed gain. Warm the arm up, or calibrate it again with a run recorded today.",
    )
