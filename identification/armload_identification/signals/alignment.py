"""Two runs of one motion without a known period: their positions as splines, and the time shift between them.

Samples are not differentiated: the measured position is fitted by a quintic spline by least squares, at the original
time stamps, and the spline is differentiated. The spacing of its knots is chosen by generalised cross-validation. The
runs are aligned by position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.signals.repetition import fast_length
from armload_identification.signals.signal_constants import RunAlignment, SplineFit
from armload_identification.signals.spline import Spline


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured positions of one run as a function of time.

    Attributes:
        spline: (n,)-valued quintic spline of the time since the first sample.
        duration_s: Time of the last sample since the first.
        fit_rad: (n,) RMS of the samples about the spline.
    """

    spline: Spline
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
    elapsed = time_s - time_s[0]
    interval_s = float(np.median(np.diff(elapsed)))
    spacing_s = min(SplineFit.coarsest_s, elapsed[-1] / SplineFit.fewest_pieces)
    best: tuple[float, Spline, FloatArray] | None = None
    while spacing_s >= SplineFit.samples_per_coefficient * interval_s:
        fine = spacing_s < SplineFit.samples_per_knot * interval_s
        knots = _knots(elapsed, spacing_s)
        coefficients = knots.size - SplineFit.degree - 1
        if coefficients * SplineFit.samples_per_coefficient < elapsed.size:
            spline = Spline.fit(elapsed, position_rad, knots, SplineFit.degree)
            misfit = np.mean((position_rad - spline(elapsed)) ** 2, axis=0)
            # The sum of logarithms prevents joints with a large stroke from dominating.
            logarithms = np.log(misfit + SplineFit.negligible_rad**2)
            score = float(np.sum(logarithms) - 2 * misfit.size * np.log1p(-coefficients / elapsed.size))
            needed = misfit.size * np.log(SplineFit.motion_over_noise) if fine else 0.0
            if best is None or score < best[0] - needed:
                best = (score, spline, np.sqrt(misfit))
            elif fine:
                break
        spacing_s *= 0.5
    if best is None:
        raise RecordingError(
            f"{elapsed.size} samples over {elapsed[-1]:.3g} s are not enough to fit a motion. Record a longer run."
        )
    return MeasuredMotion(best[1], float(elapsed[-1]), best[2])


def _knots(elapsed: FloatArray, spacing_s: float) -> FloatArray:
    """Knots of a spline; gaps in the data contain none, so that samples determine every coefficient."""
    pieces = max(1, round(elapsed[-1] / spacing_s))
    edges = np.linspace(0.0, elapsed[-1], pieces + 1)
    counts = np.histogram(elapsed, edges)[0]
    enough = counts >= SplineFit.samples_per_coefficient
    inner = edges[1:-1][enough[:-1] & enough[1:]]
    ends = SplineFit.degree + 1
    return np.concatenate([[0.0] * ends, inner, [elapsed[-1]] * ends])


def time_shift(first: MeasuredMotion, second: MeasuredMotion) -> float:
    """Time to add to the first run's elapsed time to obtain the corresponding time of the second run.

    The initial value comes from the cross-correlation of all joints' velocities; then the positions are aligned by
    least squares (Gauss-Newton in one unknown).

    Args:
        second: Another run of the same motion.

    Returns:
        Shift in s, accurate to a small part of the sampling interval.

    Raises:
        RecordingError: the runs have less than one second of motion in common.
    """
    longest_s = max(first.duration_s, second.duration_s)
    step_s = min(RunAlignment.grid_s, longest_s / RunAlignment.fewest_times)
    grid = np.arange(0.0, longest_s, step_s)
    length = fast_length(2 * grid.size)
    speeds = []
    for motion in (first, second):
        speed = motion.spline(np.minimum(grid, motion.duration_s), 1)
        speed[grid > motion.duration_s] = 0.0
        speeds.append(np.fft.rfft(speed, length, axis=0))
    correlation = np.fft.irfft(np.sum(np.conj(speeds[0]) * speeds[1], axis=1), length)
    lag = int(np.argmax(correlation))
    shift_s = (lag - length if lag > grid.size else lag) * step_s
    for _ in range(RunAlignment.steps):
        common = grid[(grid <= first.duration_s) & (grid + shift_s >= 0.0) & (grid + shift_s <= second.duration_s)]
        if common.size * step_s < RunAlignment.shortest_s:
            raise RecordingError(
                "the loaded and the unloaded run have no common motion. Record the same excitation in both runs."
            )
        ahead = first.spline(common) - second.spline(common + shift_s)
        speed = second.spline(common + shift_s, 1)
        alike = np.abs(ahead).max(axis=1) < RunAlignment.elsewhere_rad
        if np.count_nonzero(alike) > RunAlignment.same_share * alike.size:
            ahead, speed = ahead[alike], speed[alike]
        power = float(np.sum(speed**2))
        if power == 0.0:
            break
        correction_s = float(np.sum(ahead * speed)) / power
        shift_s += float(np.clip(correction_s, -RunAlignment.largest_step_s, RunAlignment.largest_step_s))
        if abs(correction_s) < RunAlignment.settled_s:
            break
    return shift_s
