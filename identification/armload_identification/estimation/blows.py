"""Samples that the model does not explain because somebody or something hit the arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.estimation_constants import Blows
from armload_identification.float_array import FloatArray


def struck_samples(size: FloatArray, time_s: FloatArray) -> NDArray[np.bool_]:
    """Samples close to a blow: so far off that neither noise nor friction explains them.

    A person leans on the arm, a cable catches, a brake drags for a moment. Least squares squares such residuals: on one
    UR10e run a blow of 0.3 s changes the payload's mass by 0.4 % and widens its interval by a third.

    Args:
        size: (N, n) residuals divided by their standard deviation; 0 for joints that are not to be checked.
        time_s: (N,) increasing.

    Returns:
        (N,) True within 0.4 s of a blow; all False if that would be more than a tenth of the run.
    """
    ranked = np.sort(np.abs(size), axis=1)
    hit = time_s[(ranked[:, -1] > Blows.struck) & (ranked[:, -2:].min(axis=1) > 0.5 * Blows.struck)]
    reach_s = Blows.around_s + Blows.rounding_s
    near = np.searchsorted(hit, time_s + reach_s, side="right") > np.searchsorted(hit, time_s - reach_s)
    return near if np.count_nonzero(near) <= Blows.most * near.size else np.zeros_like(near)
