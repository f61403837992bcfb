"""Is a recording's friction still that of the calibrated arm?

A gear's friction drifts as it warms up, and a calibration knows by how much it did from run to run. What a recording
leaves of the arm's own torque is fitted with changes of Coulomb and viscous friction and of the offset, expected to be
of that size. A change far beyond it says that the calibration no longer holds: a cold arm, another lubricant, a worn
gear, or another gain.

How far a joint's change x of Coulomb and viscous friction is from none, in standard deviations:

    sqrt(x^T (D + C)^-1 x),    D = diag(variances between the runs of the calibration), C covariance of x by the fit

A short run shows the sum of both at its speed far better than either, so that they err in opposite directions: C says
so. Where both are well known, neither hides the other.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.model.body_model import smooth_sign

FAR: Final = 5.0
"""Standard deviations of drift between runs and of the fit together."""
_INDEPENDENT_HZ: Final = 2.0
"""Residuals of moving joints are alike for about half a second."""
_REVERSAL: Final = 0.10
"""Below this share of a joint's greatest speed friction is what no model says."""


def friction_change(
    arm: KnownArm, velocity_rad_s: FloatArray, left_nm: FloatArray, used: NDArray[np.bool_], interval_s: float
) -> tuple[FloatArray, FloatArray]:
    """By how much friction differs from that of the calibration's runs.

    Args:
        arm: The calibrated arm.
        velocity_rad_s: (K, n) of a run.
        left_nm: (K, n) its torque less that of the calibrated arm, payload and friction included.
        used: (K,) which samples count.
        interval_s: Time between them.

    Returns:
        (2, n) changes of Coulomb friction (N m) and viscous friction (N m s/rad), and their (n, 2, 2) covariance.
    """
    direction = smooth_sign(velocity_rad_s, arm.fit.model.reversal_speed_rad_s)
    moving = np.abs(velocity_rad_s) > _REVERSAL * np.abs(velocity_rad_s).max(axis=0)
    weight = _INDEPENDENT_HZ * interval_s / np.maximum(arm.fit.residual_rms_nm, np.finfo(float).tiny) ** 2
    n = left_nm.shape[1]
    found, covariance = np.zeros((2, n)), np.zeros((n, 2, 2))
    for joint in range(n):
        rows = used & moving[:, joint]
        columns = np.stack([direction[rows, joint], velocity_rad_s[rows, joint], np.ones(np.count_nonzero(rows))], 1)
        columns = columns * arm.drift[:, joint]
        unit = np.linalg.inv(np.eye(3) + weight[joint] * columns.T @ columns)
        change = unit @ (weight[joint] * columns.T @ left_nm[rows, joint])
        scale = arm.drift[:2, joint]
        found[:, joint] = scale * change[:2]
        covariance[joint] = scale[:, None] * unit[:2, :2] * scale
    return found, covariance


def standard_deviations(change: FloatArray, covariance: FloatArray, drift: FloatArray) -> FloatArray:
    """How far each joint's friction is from that of the calibration.

    Args:
        change: (2, n) of Coulomb friction (N m) and viscous friction (N m s/rad), as fitted.
        covariance: (n, 2, 2) of these, by the fit.
        drift: (2, n) standard deviations of both between runs.

    Returns:
        (n,) standard deviations of drift and fit together.
    """
    both = covariance + drift.T[:, :, None] ** 2 * np.eye(2)
    return np.asarray(np.sqrt(np.einsum("in,nij,jn->n", change, np.linalg.inv(both), change)))


def friction_notes(change: FloatArray) -> tuple[str, ...]:
    """What the operator should know of it.

    Args:
        change: (n,) as `standard_deviations`.
    """
    far = np.flatnonzero(change > FAR)
    if not far.size:
        return ()
    joints = ", ".join(f"{joint + 1} ({change[joint]:.0f} standard deviations)" for joint in far)
    return (
        f"The friction of joint {joints} is far outside its variation in the calibration: a cold arm, a different "
        "lubricant, or a changed gain. Warm the arm up, or calibrate it again with a run recorded today.",
    )
