"""Blows to an arm: a few samples so far off that no noise and no friction explains them.

A person leans on the arm, a cable catches, a brake drags for a moment. Least squares weighs by the square: on one
shared UR10e run a blow of 0.3 s moves the payload's mass by 0.4 % and widens its interval by a third.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

STRUCK: Final = 8.0
"""Standard deviations from which a sample is a blow, if another joint is off by half as much: a blow shakes the whole
arm, friction at a reversal is one joint's."""
_AROUND_S: Final = 0.4
_ROUNDING_S: Final = 1e-6
_MOST: Final = 0.10
"""Where more of a run than this is off, no blow explains it."""


def struck_samples(size: FloatArray, time_s: FloatArray) -> NDArray[np.bool_]:
    """Samples about a blow.

    Args:
        size: (N, n) residuals over their standard deviation, 0 where a joint does not count.
        time_s: (N,) increasing.

    Returns:
        (N,) True within 0.4 s of a sample that is struck; nowhere where that would be much of the run.
    """
    ranked = np.sort(np.abs(size), axis=1)
    hit = time_s[(ranked[:, -1] > STRUCK) & (ranked[:, -2:].min(axis=1) > 0.5 * STRUCK)]
    if not hit.size:
        return np.zeros(len(time_s), dtype=bool)
    after = np.searchsorted(hit, time_s)
    away = np.minimum(
        np.abs(time_s - hit[np.minimum(after, hit.size - 1)]), np.abs(time_s - hit[np.maximum(after - 1, 0)])
    )
    near = away <= _AROUND_S + _ROUNDING_S
    return near if near.mean() <= _MOST else np.zeros_like(near)
