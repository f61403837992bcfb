"""Uncertainty of a torque that is sampled once per cycle.

A drive interpolates its setpoints linearly from cycle to cycle, so that the demanded speed changes in steps, and torque
and acceleration vary within a cycle. What the drive reports at the SYNC belongs to one instant, the measured motion to
the whole cycle. The arm's part of this cancels between the two runs, the payload's does not: its inertial torque seems
a little greater, at all joints by the same share, which grows with the square of the cycle. On simulated arms (position
gain 25 1/s, velocity loop 40 Hz) it was 0.2 to 0.6 % with a cycle of 10 ms; 3 kg were found to be 5 g too heavy, and
2 g with setpoints every 2 ms. Loops differ, and it is small, so that it is not corrected but widens the intervals.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import payload_regressor

_SHARE: Final = 0.003
"""Its standard deviation with a cycle of `_CYCLE_S` or more, as a share of the payload's inertial torque."""
_CYCLE_S: Final = 0.01


def sampling_doubt(rows: ArmRows, chain: Chain, theta: FloatArray, interval_s: float) -> FloatArray:
    """Torque of one standard deviation of this error.

    Args:
        rows: N rows of a loaded run.
        theta: (10,) the payload.
        interval_s: Time between the run's samples.

    Returns:
        (1, N, n).
    """
    still = np.zeros_like(rows.position_rad)
    inertial = (rows.payload - payload_regressor(chain, rows.position_rad, still, still)) @ theta
    return np.asarray(_SHARE * min(interval_s / _CYCLE_S, 1.0) ** 2 * inertial[None])
