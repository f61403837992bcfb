"""Residual of a prediction for single raw samples, comparable with their noise.

Both refer to the difference of two RAW torque samples, one of a loaded and one of an unloaded run at the same position
of the motion, neither averaged nor smoothed. The noise is its standard deviation, from the scatter of single samples
between periods or, with one period, from third differences, that is from the signal above the motion's band.
"""

from __future__ import annotations

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.signals.load_signal import LoadSignal


def raw_residual_rms(signal: LoadSignal, predicted_nm: FloatArray) -> FloatArray:
    """(n,) RMS in N m of single samples minus (K, n) prediction, by averages and the noise that they removed."""
    averaged = np.mean((signal.raw_nm - predicted_nm)[signal.valid] ** 2, axis=0)
    return np.asarray(np.sqrt(averaged + signal.noise_nm**2 - signal.averaged_noise_nm**2))
