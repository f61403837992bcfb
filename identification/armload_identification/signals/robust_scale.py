"""Scale of a distribution from a median, which outliers do not affect."""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray

_MEDIAN_OF_NORMAL: Final = 0.674490
"""Median of the absolute value of a standard normal variable."""


def deviation_by_median(values: FloatArray) -> FloatArray:
    """Standard deviation of zero-mean normal values, estimated as median |value| / 0.6745.

    Args:
        values: (N, n) or (N,) values about zero.

    Returns:
        (n,) standard deviations, or one.
    """
    return np.asarray(np.median(np.abs(values), axis=0) / _MEDIAN_OF_NORMAL)
