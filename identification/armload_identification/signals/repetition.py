"""Detection of a repeating motion and its period."""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.signals.signal_constants import Repetition, Standstill


def repeated_after(elapsed_s: FloatArray, position_rad: FloatArray) -> float | None:
    """Shortest period of a motion that contains at least two periods.

        r(T) = 2 sum q(t) q(t + T) / sum (q(t)^2 + q(t + T)^2),    over all joints that move

    Args:
        elapsed_s: (N,) increasing times.
        position_rad: (N, n) positions.

    Returns:
        The period in s; None if the motion does not repeat.

    References:
        McLeod, Wyvill, A smarter way to find pitch, ICMC 2005, equation 8.
    """
    from scipy.fft import next_fast_len

    samples = min(elapsed_s.size, Repetition.most_samples)
    if samples < Repetition.fewest_samples:
        return None
    times = np.linspace(elapsed_s[0], elapsed_s[-1], samples)
    moving = np.flatnonzero(np.ptp(position_rad, axis=0) > Standstill.travel_rad)
    if not moving.size:
        return None
    motion = np.column_stack([np.interp(times, elapsed_s, position_rad[:, joint]) for joint in moving])
    motion = (motion - motion.mean(axis=0)) / motion.std(axis=0)
    length = next_fast_len(2 * samples, real=True)
    spectrum = np.fft.rfft(motion, length, axis=0)
    product = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1), length)[:samples]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(motion**2, axis=1))])
    lags = np.arange(samples // 2 + 1)
    both = energy[samples - lags] + energy[samples] - energy[lags]
    alike = 2.0 * product[lags] / np.maximum(both, np.finfo(float).tiny)
    apart = np.flatnonzero(alike < Repetition.unlike)
    inner = alike[1:-1]
    peaks = np.flatnonzero((inner >= alike[:-2]) & (inner > alike[2:]) & (inner >= Repetition.alike)) + 1
    peaks = peaks[peaks > np.append(apart, alike.size)[0]]
    if not peaks.size:
        return None
    lag = int(peaks[0])
    before, here, after = alike[lag - 1 : lag + 2]
    shift = 0.5 * (before - after) / (before - 2.0 * here + after)
    return float((lag + shift) * (times[1] - times[0]))
