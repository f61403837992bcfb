"""Whether runs prove that the arm carries nothing; decided before a joint is blamed for not showing a payload."""

from __future__ import annotations

import numpy as np

from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, student_half_width
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import NothingMounted
from armload_identification.verdict.decision_levels import EmptyArmLevels, FalseAlarms


def is_slight(plain: PayloadEstimate, half_width_kg: float, regressor: FloatArray, arm_nm: FloatArray) -> bool:
    """Whether only a small share of the arm's own torque can be that of a payload, whatever is wrong.

    Unexplained torque may be that of a payload with wrong gravity, joint order or kinematics. Arguments as of
    `refuse_nothing`.
    """
    most_kg = max(float(plain.theta[0]), 0.0) + half_width_kg
    per_kg, own_nm = (float(np.sqrt(np.sum(np.mean(torque**2, axis=0)))) for torque in (regressor[..., 0], arm_nm))
    left_nm = float(np.linalg.norm(plain.posterior.residual_nm[0]))
    return most_kg * per_kg <= EmptyArmLevels.torque_share * own_nm and left_nm <= EmptyArmLevels.left_share * own_nm


def refuse_nothing(
    plain: PayloadEstimate, regressor: FloatArray, arm_nm: FloatArray, floor_kg: float = 0.0, where: str = ""
) -> None:
    """Raise if the interval of the mass contains 0, and a payload within it is slight.

    An estimate below 0 is not a payload either, as long as the interval does not certainly exclude 0.

    Args:
        regressor: (K, n, 10) payload columns of the run.
        arm_nm: (K, n) torque of the arm itself, N m.
        floor_kg: Standard deviation of a mass's error that is not in the estimate.
        where: Beginning of the message.

    Raises:
        NothingMounted: with the mass and its interval.
    """
    variance, freedom = plain.spread(np.eye(4, plain.theta.size))
    half_width = student_half_width(freedom) * np.sqrt(variance)
    mass_kg, half_width_kg = float(plain.theta[0]), float(np.hypot(half_width[0], NORMAL_HALF_WIDTH * floor_kg))
    compatible = (np.abs(plain.theta[1:4]) <= FalseAlarms.certain_half_widths * half_width[1:]).all()
    empty = -FalseAlarms.certain_half_widths * half_width_kg <= mass_kg <= half_width_kg
    if compatible and empty and is_slight(plain, half_width_kg, regressor, arm_nm):
        raise NothingMounted(mass_kg, half_width_kg, where)
