"""Whether runs prove that the arm carries nothing; decided before a joint is blamed for not showing a payload."""

from __future__ import annotations

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, student_half_width
from armload_identification.identification_errors import NothingMounted
from armload_identification.verdict.decision_levels import EmptyArmLevels, FalseAlarms


def refuse_nothing(
    plain: PayloadEstimate, regressor: FloatArray, arm_nm: FloatArray, floor_kg: float = 0.0, where: str = ""
) -> None:
    """Raise if the interval of the mass contains 0 and excludes everything but a small share of the arm's own torque.

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
    most_kg = max(mass_kg + half_width_kg, half_width_kg)
    per_kg, own_nm = (float(np.sqrt(np.sum(np.mean(torque**2, axis=0)))) for torque in (regressor[..., 0], arm_nm))
    if compatible and empty and most_kg * per_kg <= EmptyArmLevels.torque_share * own_nm:
        raise NothingMounted(mass_kg, half_width_kg, where)
