"""Whether a recording's friction is still that of the calibrated arm.

A gear's friction drifts as it warms up, and a calibration contains its spread between runs. The residual of the arm's
own torque in a recording is fitted with changes of Coulomb and viscous friction and of the offset, expected to be of
that size. With a change far beyond it the calibration is no longer valid: a cold arm, another lubricant, a worn gear,
or another gain.

Size of a joint's change x of Coulomb and viscous friction, in standard deviations:

    sqrt(x^T (D + C)^-1 x),    D = diag(variances between the runs of the calibration), C covariance of x by the fit

A short run determines the sum of both at its speed far better than each, so that their errors are anticorrelated, which
C contains.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.model.body_model import smooth_sign
from armload_identification.signals.reversals import REVERSAL
from armload_identification.verdict.decision_levels import ColdArm
from armload_identification.verdict.joint_words import named_joints

FAR: Final = ColdArm.far_deviations
"""For the rooms above."""


def friction_difference(
    arm: KnownArm, velocity_rad_s: FloatArray, left_nm: FloatArray, used: NDArray[np.bool_], interval_s: float
) -> tuple[FloatArray, FloatArray]:
    """Difference of a run's friction from that of the calibration's runs.

    Args:
        arm: The calibrated arm.
        velocity_rad_s: (K, n) of a run.
        left_nm: (K, n) its torque minus that of the calibrated arm, payload and friction included.
        used: (K,) True for samples to use.
        interval_s: Time between samples.

    Returns:
        (2, n) changes of Coulomb friction (N m) and viscous friction (N m s/rad), and their (n, 2, 2) covariance.
    """
    direction = smooth_sign(velocity_rad_s, arm.fit.model.reversal_speed_rad_s)
    moving = np.abs(velocity_rad_s) > REVERSAL * np.abs(velocity_rad_s).max(axis=0)
    weight = ColdArm.independent_hz * interval_s / np.maximum(arm.fit.residual_rms_nm, np.finfo(float).tiny) ** 2
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
    """Size of each joint's change of friction.

    Args:
        change: (2, n) fitted changes of Coulomb friction (N m) and viscous friction (N m s/rad).
        covariance: (n, 2, 2) their covariance from the fit.
        drift: (2, n) standard deviations of both between runs.

    Returns:
        (n,) in standard deviations of drift and fit together.
    """
    both = covariance + drift.T[:, :, None] ** 2 * np.eye(2)
    return np.asarray(np.sqrt(np.einsum("in,nij,jn->n", change, np.linalg.inv(both), change)))


def friction_notes(change: FloatArray) -> tuple[str, ...]:
    """Notes to the operator about (n,) changes of friction from `standard_deviations`."""
    far = np.flatnonzero(change > FAR)
    if not far.size:
        return ()
    joints = named_joints([f"{joint + 1} ({change[joint]:.0f} standard deviations)" for joint in far])
    return (
        f"The friction of {joints} is far outside its variation in the calibration: a cold arm, a different "
        "lubricant, or a changed gain. Warm the arm up, or calibrate it again with a run recorded today.",
    )
