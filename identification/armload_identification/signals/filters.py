"""Filters for measured signals, and estimation of their noise.

Averages of whole periods are smoothed by the five-point cubic smoothing of Chen 2016; runs without a period by a
zero-phase low-pass chosen according to the motion's band. scipy.signal has that low-pass too, but takes a third of a
second to load, a sixth of an identification's time.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.signals.robust_scale import deviation_by_median

SMOOTHING_PASSES: Final = 5
SMOOTHING_LOSS_LIMIT: Final = 0.10
"""Chen 2016: at most this share of a signal's RMS may be lost by smoothing."""
_WINDOW: Final = 5
_POWERS: Final = np.vander(np.arange(_WINDOW) - 2.0, 4)
_CUBIC: Final = _POWERS @ np.linalg.pinv(_POWERS)
"""Matrix from five values to those of the best-fitting cubic."""
_LOW_PASS_ORDER: Final = 4
_LOW_PASS_BANDS: Final = 8.0
_BAND_POWER: Final = 0.999
_THIRD_DIFFERENCE_GAIN: Final = 20.0
"""Variance of a third difference of unit white noise: 1 + 9 + 9 + 1."""


def smooth(values: FloatArray) -> FloatArray:
    """Five-point cubic smoothing, five passes.

    Args:
        values: (N, n), N at least 5.

    Returns:
        (N, n) smoothed along the first axis.

    References:
        Chen 2016, eq. (8): with its four rows for the ends, a Savitzky-Golay filter of window 5 and order 3
        with interpolated ends.
    """
    for _ in range(SMOOTHING_PASSES):
        inner = np.lib.stride_tricks.sliding_window_view(values, _WINDOW, axis=0) @ _CUBIC[2]
        values = np.concatenate([_CUBIC[:2] @ values[:_WINDOW], inner, _CUBIC[3:] @ values[-_WINDOW:]])
    return values


def smoothing_loss(raw: FloatArray, smoothed: FloatArray) -> FloatArray:
    """Share of each signal's RMS removed by a filter, 1 - RMS(smoothed) / RMS(raw).

    Args:
        raw: (N, n) before.
        smoothed: (N, n) after.

    Returns:
        (n,) between 0 and 1; 0 for a zero signal.
    """
    before = np.sqrt(np.mean(raw**2, axis=0))
    after = np.sqrt(np.mean(smoothed**2, axis=0))
    return np.asarray(1.0 - np.divide(after, before, out=np.ones_like(before), where=before > 0.0))


def low_pass(values: FloatArray, interval_s: float, cutoff_hz: float) -> FloatArray:
    """Zero-phase low-pass: a Butterworth filter of order 4, forwards and backwards, after the bilinear transform.

    It is applied to the spectrum as the real gain 1 / (1 + (tan(pi f T) / tan(pi f_c T))^8). The ends are extended by
    their point reflection, and the straight line through the extended ends, which the filter passes, is taken out, so
    that the circular convolution finds no step. `scipy.signal.sosfiltfilt` differs only near the ends, where it
    extrapolates in a different way: by 1e-8 of the torque of a recorded motion.

    Args:
        values: (N, n) finite, equidistant.
        interval_s: Time T between samples.
        cutoff_hz: Frequency f_c at which each of the two passes attenuates by 3 dB.

    Returns:
        (N, n) filtered along the first axis, without delay.
    """
    rows = values.shape[0]
    pad = min(rows - 1, int(3.0 / (cutoff_hz * interval_s)))
    extended = rows + 2 * pad
    ratio = np.tan(np.pi * np.fft.rfftfreq(extended)) / np.tan(np.pi * cutoff_hz * interval_s)
    gain = 1.0 / (1.0 + ratio ** (2 * _LOW_PASS_ORDER))
    filtered = np.empty(values.shape)
    for column, out in zip(values.T, filtered.T, strict=True):
        ends = 2.0 * column[0] - column[pad:0:-1], 2.0 * column[-1] - column[-2 : -pad - 2 : -1]
        wave = np.concatenate([ends[0], column, ends[1]])
        line = np.linspace(wave[0], wave[-1], extended)
        out[:] = (np.fft.irfft(gain * np.fft.rfft(wave - line), extended) + line)[pad : pad + rows]
    return filtered


def low_pass_cutoff(velocity: FloatArray, interval_s: float) -> float:
    """Cutoff frequency in Hz of the low-pass for a motion: a multiple of the band containing nearly all of its power.

    Args:
        velocity: (K, n) equidistant velocities in rad/s.
        interval_s: Time between samples.
    """
    power = np.sum(np.abs(np.fft.rfft(velocity * np.hanning(velocity.shape[0])[:, None], axis=0)) ** 2, axis=1)
    total = np.cumsum(power)
    index = int(np.searchsorted(total, _BAND_POWER * total[-1]))
    band_hz = float(np.fft.rfftfreq(velocity.shape[0], interval_s)[index])
    return min(max(_LOW_PASS_BANDS * band_hz, 2.0), 0.25 / interval_s)


def white_noise(values: FloatArray) -> FloatArray:
    """Standard deviation of the white noise on every sample, from third differences.

    A third difference removes every signal that is nearly quadratic over four samples, such as an excitation, and
    amplifies the variance of white noise by 20. Its size is estimated from the median, because friction at a reversal
    causes outliers: with the RMS, the noise of a wrist was 1.7 times too large.

    Args:
        values: (N, n) raw samples, N at least 4.

    Returns:
        (n,) standard deviations.
    """
    difference = np.diff(values, n=3, axis=0)
    usual = deviation_by_median(difference)
    # A coarsely quantised signal has so many repeated values that the median is 0.
    spread = np.where(usual > 0.0, usual, np.sqrt(np.mean(difference**2, axis=0)))
    return np.asarray(spread / np.sqrt(_THIRD_DIFFERENCE_GAIN))
