"""Filters for measured signals, and estimation of their noise.

Averages of whole periods are smoothed by the five-point cubic smoothing of Chen 2016; runs without a period by a
zero-phase low-pass chosen according to the motion's band. scipy.signal has that low-pass too, but takes a third of a
second to load, a sixth of an identification's time.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.signals.robust_scale import deviation_by_median
from armload_identification.signals.signal_constants import LowPass, SampleNoise, Smoothing

_MIDDLE: Final = Smoothing.window // 2
_POWERS: Final = np.vander(np.arange(Smoothing.window) - float(_MIDDLE), Smoothing.order + 1)
_CUBIC: Final = _POWERS @ np.linalg.pinv(_POWERS)
"""Matrix from five values to those of the best-fitting cubic."""


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
    window = Smoothing.window
    for _ in range(Smoothing.passes):
        inner = np.lib.stride_tricks.sliding_window_view(values, window, axis=0) @ _CUBIC[_MIDDLE]
        values = np.concatenate([_CUBIC[:_MIDDLE] @ values[:window], inner, _CUBIC[_MIDDLE + 1 :] @ values[-window:]])
    return values


def smoothing_loss(raw: FloatArray, smoothed: FloatArray) -> FloatArray:
    """(n,) share of the RMS of (N, n) removed by a filter, 1 - RMS(smoothed) / RMS(raw); 0 for a zero signal."""
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
    pad = min(rows - 1, int(LowPass.padding / (cutoff_hz * interval_s)))
    extended = rows + 2 * pad
    ratio = np.tan(np.pi * np.fft.rfftfreq(extended)) / np.tan(np.pi * cutoff_hz * interval_s)
    gain = 1.0 / (1.0 + ratio ** (2 * LowPass.order))
    filtered = np.empty(values.shape)
    for column, out in zip(values.T, filtered.T, strict=True):
        ends = 2.0 * column[0] - column[pad:0:-1], 2.0 * column[-1] - column[-2 : -pad - 2 : -1]
        wave = np.concatenate([ends[0], column, ends[1]])
        line = np.linspace(wave[0], wave[-1], extended)
        out[:] = (np.fft.irfft(gain * np.fft.rfft(wave - line), extended) + line)[pad : pad + rows]
    return filtered


def low_pass_cutoff(velocity: FloatArray, interval_s: float) -> float:
    """Cutoff in Hz of the low-pass for (K, n) rad/s: a multiple of the band with nearly all of their power."""
    power = np.sum(np.abs(np.fft.rfft(velocity * np.hanning(velocity.shape[0])[:, None], axis=0)) ** 2, axis=1)
    total = np.cumsum(power)
    index = int(np.searchsorted(total, LowPass.band_power * total[-1]))
    band_hz = float(np.fft.rfftfreq(velocity.shape[0], interval_s)[index])
    return min(max(LowPass.bands * band_hz, LowPass.lowest_hz), LowPass.highest_of_rate / interval_s)


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
    return np.asarray(spread / np.sqrt(SampleNoise.third_difference_gain))
