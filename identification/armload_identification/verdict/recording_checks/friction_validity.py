"""Whether a recording's friction is still that of the calibrated arm.

A gear's friction drifts as it warms up, and a calibration contains its spread between runs. With a change far beyond
that spread the calibration is no longer valid: a cold arm, another lubricant, a worn gear, or another gain.

Size of a joint's change x of Coulomb and viscous friction, in standard deviations:

    sqrt(x^T (D + C)^-1 x),    D = diag(variances between the runs of the calibration), C covariance of x by the fit

A short run determines the sum of both at its speed far better than each, so that their errors are anticorrelated, which
C contains.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.verdict.decision_levels import ColdArm
from armload_identification.verdict.joint_words import remarked_joints


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


def friction_notes(change: FloatArray) -> Iterator[str]:
    """Notes to the operator about (n,) changes of friction from `standard_deviations`."""
    if joints := remarked_joints(change > ColdArm.far_deviations, "{:.0f} standard deviations", change):
        yield (
            f"The friction of {joints} is far outside its variation in the calibration: a cold arm, a different "
            "lubricant, or a changed gain. Warm the arm up, or calibrate it again with a run recorded today."
        )
