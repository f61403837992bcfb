"""Blows to an arm: a few samples so far off that neither noise nor friction explains them.

A person leans on the arm, a cable catches, a brake drags for a moment. Least squares squares such residuals: on one
UR10e run a blow of 0.3 s changes the payload's mass by 0.4 % and widens its interval by a third.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

STRUCK: Final = 8.0
"""Threshold in standard deviations; a second joint must exceed half of it, because a blow shakes the entire arm while
friction at a reversal affects one joint."""
_AROUND_S: Final = 0.4
_ROUNDING_S: Final = 1e-6
_MOST: Final = 0.10
"""If a greater share of a run is off, the cause is not a blow."""


def struck_samples(size: FloatArray, time_s: FloatArray) -> NDArray[np.bool_]:
    """Samples close to a blow.

    Args:
        size: (N, n) residuals divided by their standard deviation; 0 for joints that are not to be checked.
        time_s: (N,) increasing.

    Returns:
        (N,) True within 0.4 s of a blow; all False if that would be more than a tenth of the run.
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
