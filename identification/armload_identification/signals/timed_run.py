"""A run as a function of time: positions as a spline, torque, and the time shift between two runs of one motion.

Samples are not differentiated: the measured position is fitted by a quintic spline by least squares, at the original
time stamps, and the spline is differentiated. The spacing of its knots is chosen by generalised cross-validation. The
runs are aligned by position. Torque is interpolated to a grid and low-passed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.recording.recording import Recording
from armload_identification.signals.filters import low_pass, low_pass_cutoff, smoothing_loss, white_noise
from armload_identification.signals.motion import ABOVE_BAND, Motion
from armload_identification.signals.repetition import fast_length, fast_part
from armload_identification.signals.signal_constants import LowPass, RunAlignment, SplineFit, Standstill
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


@dataclass(frozen=True, eq=False)
class Grid:
    """Equidistant times at which a run is sampled, and the filter for its torque.

    Attributes:
        elapsed_s: (K,) times since the run's first sample.
        interval_s: Time between them.
        cutoff_hz: Cutoff of the low-pass.
    """

    elapsed_s: FloatArray
    interval_s: float
    cutoff_hz: float

    def later(self, by_s: float) -> Grid:
        """The same grid, every time later by `by_s`."""
        return replace(self, elapsed_s=self.elapsed_s + by_s)


@dataclass(frozen=True, eq=False)
class TimedRun:
    """A run as a function of time, which can be sampled at any times.

    Attributes:
        recording: The rows of its motion.
        path: Its measured position as a spline.
        torque_nm: (N, n) its joint torque.
    """

    recording: Recording
    path: MeasuredMotion
    torque_nm: FloatArray

    def moving_grid(self, start_s: float, end_s: float) -> Grid:
        """Times from the first to the last movement in a part of the run, spaced as its samples.

        Raises:
            RecordingError: nearly all of the run is missing.
        """
        apart_s = np.diff(self.recording.time_s)
        interval_s = float(np.median(apart_s))
        # Stamps since 1970 are rounded to 0.2 us: of the whole run, so that a grid of an hour stays at the samples.
        interval_s = float(apart_s.sum() / np.round(apart_s / interval_s).sum())
        if (end_s - start_s) / interval_s > Standstill.samples_over_rows * self.recording.size:
            raise RecordingError(
                f"{self.recording.source.path}: {self.recording.size} rows, mostly {interval_s:.3g} s apart, in "
                f"{end_s - start_s:.3g} s: most of the motion is missing. "
                "Record it again, or select a part without gaps."
            )
        elapsed = start_s + np.arange(int((end_s - start_s) / interval_s), dtype=np.float64) * interval_s
        velocity = self.path.spline(elapsed, 1)
        speed = np.abs(velocity).max(axis=1)
        moving = np.flatnonzero(speed > Standstill.share_of_peak_speed * speed.max())
        count = int(moving[-1] + 1 - moving[0])
        rows = slice(moving[0], moving[0] + (fast_part(count) if count >= LowPass.fast_from else count))
        return Grid(elapsed[rows], interval_s, low_pass_cutoff(velocity[rows], interval_s))

    def sampled(self, grid: Grid) -> Motion:
        """The run at the times of a grid within it."""
        stamps_s, moment_s = self.recording.time_s, grid.elapsed_s + self.recording.time_s[0]
        noise = white_noise(self.torque_nm[(stamps_s >= moment_s[0]) & (stamps_s <= moment_s[-1])])
        raw = np.column_stack([np.interp(moment_s, stamps_s, column) for column in self.torque_nm.T])
        smoothed = low_pass(raw, grid.interval_s, grid.cutoff_hz)
        after = np.clip(np.searchsorted(stamps_s, moment_s), 1, stamps_s.size - 1)
        apart_s = stamps_s[after] - stamps_s[after - 1]
        share = np.clip((moment_s - stamps_s[after - 1]) / apart_s, 0.0, 1.0)
        spline = self.path.spline
        return Motion(
            time_s=grid.elapsed_s - grid.elapsed_s[0],
            periodic=False,
            states=JointStates(*(spline(grid.elapsed_s, order) for order in range(3))),
            raw_nm=raw,
            torque_nm=smoothed,
            valid=apart_s <= max(LowPass.hole / grid.cutoff_hz, LowPass.uneven * grid.interval_s),
            noise_nm=noise,
            # Interpolation averages two samples, which reduces their noise.
            averaged_noise_nm=noise * np.sqrt(np.mean((1.0 - share) ** 2 + share**2)),
            noise_source=ABOVE_BAND,
            smoothing_loss=smoothing_loss(raw, smoothed),
            periods=1,
            position_fit_rad=self.path.fit_rad,
            began_s=float(moment_s[0]),
        )
