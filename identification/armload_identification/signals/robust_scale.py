"""Scale of a distribution from a median, which outliers do not affect."""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.signals.signal_constants import SampleNoise


def deviation_by_median(values: FloatArray) -> FloatArray:
    """(n,) or one standard deviation of (N, n) or (N,) zero-mean normal values, median |value| / 0.6745."""
    return np.asarray(np.median(np.abs(values), axis=0) / SampleNoise.median_of_normal)
