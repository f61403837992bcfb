"""Motion and joint torque of one run, at equidistant samples.

A run that contains whole periods of a known excitation becomes its average period. For any other run the position is a
spline, and the torque is interpolated to a grid and low-passed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.recording.recording import PeriodAverage, Recording
from armload_identification.recording.reduction.place_in_period import (
    SETTLING_S,
    periodic_phase,
    phases_per_period,
    whole_periods,
)
from armload_identification.signals.alignment import MeasuredMotion, fit_motion
from armload_identification.signals.filters import low_pass, low_pass_cutoff, smooth, smoothing_loss, white_noise
from armload_identification.signals.joint_torque import Transmission, joint_torque
from armload_identification.signals.periods import fold
from armload_identification.signals.repetition import fast_part
from armload_identification.signals.reversals import moving_joints
from armload_identification.signals.signal_constants import LowPass, RunAlignment, Standstill

SCATTER: Final = "scatter between periods"
ABOVE_BAND: Final = "the signal above the motion's band"


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion and torque of one run: K equidistant samples of n joints.

    Attributes:
        time_s: (K,) time since the start of the period, or of the motion.
        periodic: Whether the last sample is followed by the first.
        states: (K, n) each: fitted to the measured position, and its analytic derivatives.
        raw_nm: (K, n) measured joint torque, averaged over the periods of a periodic run.
        torque_nm: (K, n) the same, smoothed: five-point cubic for averages, else a zero-phase low-pass.
        valid: (K,) False if a sample was filled in; such samples are not used.
        noise_nm: (n,) standard deviation of one RAW sample of the torque.
        averaged_noise_nm: (n,) standard deviation in `raw_nm`, after averaging or interpolation.
        noise_source: How the noise was estimated, `SCATTER` or `ABOVE_BAND`.
        smoothing_loss: (n,) share of the RMS lost by smoothing.
        periods: Whole periods averaged; 1 without a period.
        position_fit_rad: (n,) RMS of the measured position about the fitted one.
        began_s: Time stamp of the first sample, or of the first row of periods that were averaged.
    """

    time_s: FloatArray
    periodic: bool
    states: JointStates
    raw_nm: FloatArray
    torque_nm: FloatArray
    valid: NDArray[np.bool_]
    noise_nm: FloatArray
    averaged_noise_nm: FloatArray
    noise_source: str
    smoothing_loss: FloatArray
    periods: int
    position_fit_rad: FloatArray
    began_s: float

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.torque_nm.shape[1])

    @property
    def interval_s(self) -> float:
        """Time between samples."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def moves(self) -> NDArray[np.bool_]:
        """(n,) False for joints at rest."""
        return moving_joints(self.states.position_rad)

    def with_delay(self, delay_s: float) -> Motion:
        """The same torque with the motion to which it belongs, for torques reported `delay_s` after the positions."""
        return replace(self, states=self.states.earlier(delay_s, self.interval_s))

    def with_torque_times(self, matrix: FloatArray) -> Motion:
        """The same motion with every torque tau replaced by tau M, M (n, n); the noise is not changed."""
        return replace(self, raw_nm=self.raw_nm @ matrix, torque_nm=self.torque_nm @ matrix)

    def every(self, step: int) -> Motion:
        """Every `step`-th sample."""
        if step == 1:
            return self
        return replace(
            self,
            time_s=self.time_s[::step],
            states=self.states.every(step),
            raw_nm=self.raw_nm[::step],
            torque_nm=self.torque_nm[::step],
            valid=self.valid[::step],
        )

    def part(self, start_s: float, end_s: float) -> Motion:
        """The samples from one time since the first sample up to, not including, another."""
        rows = slice(*np.searchsorted(self.time_s, [start_s, end_s]))
        return replace(
            self,
            time_s=self.time_s[rows],
            periodic=False,
            states=JointStates(*(values[rows] for values in self.states)),
            raw_nm=self.raw_nm[rows],
            torque_nm=self.torque_nm[rows],
            valid=self.valid[rows],
        )


def motion_of(run: Recording, transmission: Transmission) -> Motion:
    """Average period of a run with whole periods of a known excitation, else the part in which the arm moves.

    Raises:
        RecordingError: a run without motion, too short, or without torque.
    """
    require_motion(run)
    if whole_periods(run):
        return average_period(run, transmission, phases_per_period(run))
    return motion_over_time(run, transmission)


def motion_over_time(run: Recording, transmission: Transmission) -> Motion:
    """Motion and torque of one run from its first movement to its last, periodic or not.

    Raises:
        RecordingError: a run without motion, too short, or without torque.
    """
    require_motion(run)
    timed = TimedRun.of(run, transmission)
    return timed.sampled(timed.moving_grid(0.0, timed.path.duration_s))


def average_period(run: Recording, transmission: Transmission, phases: int) -> Motion:
    """The average period of a run at K equidistant phases; its motion passes through the same filter as its torque.

    Raises:
        RecordingError: no whole period, a phase that did not advance uniformly, or no torque.
    """
    torque = joint_torque(run, transmission)
    folded = fold(run, torque, phases)
    periods, scatter = folded.periods, folded.scatter_nm
    if run.average is not None:
        periods, scatter = run.average.periods, _scatter_of(run, run.average, transmission)
    time_s = np.arange(phases) / phases * folded.period_s
    smoothed = smooth(folded.torque_nm)
    noise = white_noise(torque) if scatter is None else scatter
    return Motion(
        time_s=time_s,
        periodic=True,
        states=JointStates(*map(smooth, folded.motion.period(phases)[:3])),
        raw_nm=folded.torque_nm,
        torque_nm=smoothed,
        valid=folded.valid,
        noise_nm=noise,
        averaged_noise_nm=noise / np.sqrt(periods),
        noise_source=ABOVE_BAND if scatter is None else SCATTER,
        smoothing_loss=smoothing_loss(folded.torque_nm, smoothed),
        periods=periods,
        position_fit_rad=folded.position_fit_rad,
        began_s=float(_moving_part(run).time_s[0]),
    )


@dataclass(frozen=True, eq=False)
class PeriodDeviation:
    """A run minus its own average period: what differs between its periods.

    Attributes:
        motion: The run over time; its torque is that minus the average of its phase, valid within the whole periods.
        since_s: (K,) phase since the start of the first period, over all periods.
        period_s: Phase of one period.
        periods: Number of whole periods.
    """

    motion: Motion
    since_s: FloatArray
    period_s: float
    periods: int

    @classmethod
    def of(cls, run: Recording, transmission: Transmission) -> PeriodDeviation:
        """The deviation of a run of several whole periods.

        Raises:
            RecordingError: as of `motion_of`.
        """
        average, over_time = (take(run, transmission) for take in (motion_of, motion_over_time))
        moving = _moving_part(run)
        phase, trajectory = periodic_phase(run)
        at_s = np.interp(over_time.time_s + over_time.began_s, moving.time_s, phase)
        samples = len(average.time_s)
        place = at_s / trajectory.period_s * samples % samples
        usual = np.column_stack(
            [np.interp(place, np.arange(samples + 1), np.append(column, column[0])) for column in average.raw_nm.T]
        )
        since_s, periods = at_s - phase[0], average.periods
        inside = (since_s >= SETTLING_S) & (since_s < periods * trajectory.period_s)
        motion = replace(over_time, raw_nm=over_time.raw_nm - usual, valid=over_time.valid & inside)
        return cls(motion, since_s, trajectory.period_s, periods)


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
        run: The rows of its motion.
        path: Its measured position as a spline.
        torque_nm: (N, n) its joint torque.
    """

    run: Recording
    path: MeasuredMotion
    torque_nm: FloatArray

    @classmethod
    def of(cls, run: Recording, transmission: Transmission) -> TimedRun:
        """Fit the motion of a run; approach and return are excluded if its phase marks them.

        Raises:
            RecordingError: too short for a spline, or without torque.
        """
        rows = _moving_part(run)
        return cls(rows, fit_motion(rows.time_s, rows.position_rad), joint_torque(rows, transmission))

    def moving_grid(self, start_s: float, end_s: float) -> Grid:
        """Times from the first to the last movement in a part of the run, spaced as its samples.

        Raises:
            RecordingError: nearly all of the run is missing.
        """
        apart_s = np.diff(self.run.time_s)
        interval_s = float(np.median(apart_s))
        # Stamps since 1970 are rounded to 0.2 us: of the whole run, so that a grid of an hour stays at the samples.
        interval_s = float(apart_s.sum() / np.round(apart_s / interval_s).sum())
        if (end_s - start_s) / interval_s > Standstill.samples_over_rows * self.run.size:
            raise RecordingError(
                f"{self.run.source.path}: {self.run.size} rows, mostly {interval_s:.3g} s apart, in "
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
        stamps_s, moment_s = self.run.time_s, grid.elapsed_s + self.run.time_s[0]
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


def require_motion(run: Recording) -> None:
    """Raise if no joint moves in a run.

    Raises:
        RecordingError: no joint moves.
    """
    if not moving_joints(run.position_rad).any():
        raise RecordingError(
            f"{run.source.path}: no joint moves more than {Standstill.travel_rad} rad, so nothing can be identified. "
            "Record a run along an excitation, and check the position columns."
        )


def _scatter_of(run: Recording, average: PeriodAverage, transmission: Transmission) -> FloatArray | None:
    """(n,) standard deviation of one raw torque sample of a run that was averaged while it was read."""
    covariance = average.effort_covariance
    if covariance is None:
        return None
    if run.torque_nm is None:
        covariance = transmission.torque_covariance(covariance)
    return np.sqrt(np.diag(covariance))


def before_periods(run: Recording) -> Recording:
    """The longest part without an interruption before a run's first phase; no rows if there is none."""
    inside = np.isfinite(np.zeros(run.size) if run.phase_s is None else run.phase_s)
    first = int(np.argmax(inside)) if inside.any() else run.size
    edges = [0, *(np.flatnonzero(np.diff(run.time_s[:first]) > RunAlignment.shortest_s) + 1), first]
    longest = int(np.argmax(np.diff(edges)))
    return replace(run.rows(slice(edges[longest], edges[longest + 1])), phase_s=None, excitation=None)


def _moving_part(run: Recording) -> Recording:
    """The run without approach and return if its phase marks them, the slow round of one without periods, else all."""
    if run.phase_s is None:
        return run
    if np.count_nonzero(np.isfinite(run.phase_s)) >= 2:
        return run.rows(np.isfinite(run.phase_s))
    if run.source.truncated:
        raise RecordingError(
            f"{run.source.path}: the recording ends before the periods of its excitation start: the file is truncated. "
            "Record it again."
        )
    return before_periods(run)
