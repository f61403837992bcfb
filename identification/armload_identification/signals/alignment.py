"""Two runs of one motion without a known period: their positions as splines, and the time shift between them.

Samples are not differentiated: the measured position is fitted by a quintic spline by least squares, at the original
time stamps, and the spline is differentiated. The spacing of its knots is chosen by generalised cross-validation. The
runs are aligned by position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_DEGREE: Final = 5
_COARSEST_KNOTS_S: Final = 2.0
_SAMPLES_PER_KNOT: Final = 8
"""Minimum; with finer knots the encoder's noise would appear in the acceleration."""
_REFINEMENTS: Final = 8
_ELSEWHERE_RAD: Final = 0.1
"""Runs this far apart are not in the same motion at that moment, such as while being jogged to the start."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured positions of one run as a function of time.

    Attributes:
        spline: (n,)-valued quintic spline of the time since `start_s`.
        start_s: Time stamp of the first sample.
        duration_s: Time of the last sample since the first.
        fit_rad: (n,) RMS of the samples about the spline.
    """

    spline: BSpline
    start_s: float
    duration_s: float
    fit_rad: FloatArray


def fit_motion(time_s: FloatArray, position_rad: FloatArray) -> MeasuredMotion:
    """Fit a quintic spline to measured positions, with the spacing of the knots chosen from the data.

    Args:
        time_s: (N,) increasing, irregular.
        position_rad: (N, n) measured positions.

    Returns:
        The motion.

    Raises:
        RecordingError: too short for a spline.
    """
    from scipy.interpolate import make_lsq_spline

    elapsed = time_s - time_s[0]
    interval_s = float(np.median(np.diff(elapsed)))
    spacing_s = min(_COARSEST_KNOTS_S, elapsed[-1] / 4.0)
    best: tuple[float, BSpline, FloatArray] | None = None
    while spacing_s > 0.0:
        knots = _knots(elapsed, spacing_s)
        coefficients = knots.size - _DEGREE - 1
        if coefficients < 0.5 * elapsed.size:
            spline = make_lsq_spline(elapsed, position_rad, knots, k=_DEGREE)
            misfit = np.mean((position_rad - spline(elapsed)) ** 2, axis=0)
            # The sum of logarithms prevents joints with a large stroke from dominating.
            score = float(np.sum(np.log(misfit + 1e-18)) - 2 * misfit.size * np.log1p(-coefficients / elapsed.size))
            if best is None or score < best[0]:
                best = (score, spline, np.sqrt(misfit))
        spacing_s *= 0.5
        if spacing_s < _SAMPLES_PER_KNOT * interval_s:
            break
    if best is None:
        raise RecordingError(
            f"{elapsed.size} samples over {elapsed[-1]:.3g} s are not enough to fit a motion. Record a longer run."
        )
    return MeasuredMotion(best[1], float(time_s[0]), float(elapsed[-1]), best[2])


def _knots(elapsed: FloatArray, spacing_s: float) -> FloatArray:
    """Knots of a spline; gaps in the data contain none, so that samples determine every coefficient."""
    pieces = max(1, round(elapsed[-1] / spacing_s))
    edges = np.linspace(0.0, elapsed[-1], pieces + 1)
    counts = np.histogram(elapsed, edges)[0]
    inner = edges[1:-1][(counts[:-1] >= 2) & (counts[1:] >= 2)]
    return np.concatenate([[0.0] * (_DEGREE + 1), inner, [elapsed[-1]] * (_DEGREE + 1)])


def time_shift(first: MeasuredMotion, second: MeasuredMotion) -> float:
    """Time to add to the first run's elapsed time to obtain the corresponding time of the second run.

    The initial value comes from the cross-correlation of all joints' velocities; then the positions are aligned by
    least squares (Gauss-Newton in one unknown).

    Args:
        first: One run.
        second: Another run of the same motion.

    Returns:
        Shift in s, accurate to a small part of the sampling interval.

    Raises:
        RecordingError: the runs have less than one second of motion in common.
    """
    longest_s = max(first.duration_s, second.duration_s)
    step_s = min(0.02, longest_s / 256.0)
    grid = np.arange(0.0, longest_s, step_s)
    speeds = []
    for motion in (first, second):
        speed = motion.spline.derivative()(np.minimum(grid, motion.duration_s))
        speed[grid > motion.duration_s] = 0.0
        speeds.append(np.fft.rfft(speed, 2 * grid.size, axis=0))
    correlation = np.fft.irfft(np.sum(np.conj(speeds[0]) * speeds[1], axis=1), 2 * grid.size)
    lag = int(np.argmax(correlation))
    shift_s = (lag - 2 * grid.size if lag > grid.size else lag) * step_s
    speed_of_second = second.spline.derivative()
    for _ in range(_REFINEMENTS):
        common = grid[(grid <= first.duration_s) & (grid + shift_s >= 0.0) & (grid + shift_s <= second.duration_s)]
        if common.size * step_s < 1.0:
            raise RecordingError(
                "the loaded and the unloaded run have no common motion. Record the same excitation in both runs."
            )
        ahead = first.spline(common) - second.spline(common + shift_s)
        speed = speed_of_second(common + shift_s)
        alike = np.abs(ahead).max(axis=1) < _ELSEWHERE_RAD
        if np.count_nonzero(alike) > 0.5 * alike.size:
            ahead, speed = ahead[alike], speed[alike]
        power = float(np.sum(speed**2))
        if power == 0.0:
            break
        correction_s = float(np.sum(ahead * speed)) / power
        shift_s += float(np.clip(correction_s, -0.5, 0.5))
        if abs(correction_s) < 1e-9:
            break
    return shift_s
