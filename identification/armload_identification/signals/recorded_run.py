"""A run: a recording with its joint torque, and the motion that follows from it, each computed once.

A run that contains whole periods of a known excitation becomes its average period. For any other run the position is a
spline, and the torque is interpolated to a grid and low-passed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.phase_advance import periodic_phase, phases_of, whole_periods
from armload_identification.recording.reduction.repeated_values import RepeatedValues, repeated_values
from armload_identification.signals.filters import low_pass, low_pass_cutoff, smoothing_loss, white_noise
from armload_identification.signals.joint_torque import Transmission, joint_torque, reported_effort, sample_scatter
from armload_identification.signals.motion import ABOVE_BAND, Motion
from armload_identification.signals.periods import fold
from armload_identification.signals.reversals import moving_joints
from armload_identification.signals.signal_constants import LowPass, RunAlignment, Standstill
from armload_identification.signals.spline import MeasuredMotion, fit_motion


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
class Run:
    """A recording of a moving arm, with its torque.

    Attributes:
        recording: The rows.
        torque_nm: (N, n) measured joint torque.
        scatter_nm: (n,) standard deviation of one raw sample of it between the periods of a recording that was averaged
            while it was read; None for any other.
    """

    recording: Recording
    torque_nm: FloatArray
    scatter_nm: FloatArray | None

    @classmethod
    def of(cls, recording: Recording, transmission: Transmission) -> Run:
        """The run with the torque that its currents, or reported torques, mean.

        Raises:
            RecordingError: no torque, a constant one, or no joint moves.
        """
        run = cls(recording, joint_torque(recording, transmission), sample_scatter(recording, transmission))
        if not moving_joints(recording.position_rad).any():
            raise RecordingError(
                f"{recording.source.path}: no joint moves more than {Standstill.travel_rad} rad, so nothing can be "
                "identified. Record a run along an excitation, and check the position columns."
            )
        return run

    @property
    def from_torque(self) -> bool:
        """Whether the drives reported torque instead of current."""
        return self.recording.torque_nm is not None

    @cached_property
    def repeats(self) -> RepeatedValues:
        """How long the effort stays the same."""
        rows = self.recording
        return repeated_values(reported_effort(rows), rows.position_rad) if rows.repeats is None else rows.repeats

    @cached_property
    def periods(self) -> int:
        """Number of whole periods of a known excitation; 0 without one."""
        return whole_periods(self.recording)

    @cached_property
    def phases(self) -> int:
        """Number of samples in a period, of a run that contains whole ones."""
        return phases_of(*periodic_phase(self.recording))

    @cached_property
    def motion(self) -> Motion:
        """Average period of a run with whole periods, else the part in which the arm moves.

        Raises:
            RecordingError: too short, or a phase that did not advance uniformly.
        """
        return self.average_period(self.phases) if self.periods else self.over_time

    @cached_property
    def over_time(self) -> Motion:
        """From the first movement to the last of the moving part, periodic or not.

        Raises:
            RecordingError: too short.
        """
        moving = self.moving_part
        return moving.sampled(moving.moving_grid(0.0, moving.path.duration_s))

    @cached_property
    def path(self) -> MeasuredMotion:
        """The measured position of all rows as a spline.

        Raises:
            RecordingError: too short for a spline.
        """
        return fit_motion(self.recording.time_s, self.recording.position_rad)

    def average_period(self, phases: int) -> Motion:
        """The average period at K equidistant phases; its motion passes through the same filter as its torque.

        Raises:
            RecordingError: no whole period, or a phase that did not advance uniformly.
        """
        return fold(self.recording, self.torque_nm, phases, self.scatter_nm)

    @cached_property
    def before_periods(self) -> Run:
        """The longest part without an interruption before the first phase, the slow round; no rows if there is none."""
        rows = self.recording
        inside = np.isfinite(np.zeros(rows.size) if rows.phase_s is None else rows.phase_s)
        first = int(np.argmax(inside)) if inside.any() else rows.size
        edges = [0, *(np.flatnonzero(np.diff(rows.time_s[:first]) > RunAlignment.shortest_s) + 1), first]
        longest = int(np.argmax(np.diff(edges)))
        part = self._part(slice(edges[longest], edges[longest + 1]))
        return replace(part, recording=replace(part.recording, phase_s=None, excitation=None))

    @cached_property
    def moving_part(self) -> Run:
        """Without approach and return if the phase marks them, the slow round of a run without periods, else all."""
        rows = self.recording
        if rows.phase_s is None:
            return self
        if np.count_nonzero(np.isfinite(rows.phase_s)) >= 2:
            return self._part(np.isfinite(rows.phase_s))
        if rows.source.truncated:
            raise RecordingError(
                f"{rows.source.path}: the recording ends before the periods of its excitation start: the file is "
                "truncated. Record it again."
            )
        return self.before_periods

    def _part(self, rows: slice | NDArray[np.bool_]) -> Run:
        return replace(self, recording=self.recording.rows(rows), torque_nm=self.torque_nm[rows])

    def moving_grid(self, start_s: float, end_s: float) -> Grid:
        """Times from the first to the last movement in a part of the run, spaced as its samples.

        Raises:
            RecordingError: nearly all of the run is missing.
        """
        from scipy.fft import prev_fast_len

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
        rows = slice(moving[0], moving[0] + (prev_fast_len(count, real=True) if count >= LowPass.fast_from else count))
        return Grid(elapsed[rows], interval_s, low_pass_cutoff(velocity[rows], interval_s))

    def sampled(self, grid: Grid) -> Motion:
        """The run at the times of a grid within it; its torque is interpolated and low-passed."""
        stamps_s, moment_s = self.recording.time_s, grid.elapsed_s + self.recording.time_s[0]
        noise = white_noise(self.torque_nm[(stamps_s >= moment_s[0]) & (stamps_s <= moment_s[-1])])
        raw = np.column_stack([np.interp(moment_s, stamps_s, column) for column in self.torque_nm.T])
        smoothed = low_pass(raw, grid.interval_s, grid.cutoff_hz)
        after = np.clip(np.searchsorted(stamps_s, moment_s), 1, stamps_s.size - 1)
        apart_s = stamps_s[after] - stamps_s[after - 1]
        share = np.clip((moment_s - stamps_s[after - 1]) / apart_s, 0.0, 1.0)
        return Motion(
            time_s=grid.elapsed_s - grid.elapsed_s[0],
            periodic=False,
            states=JointStates(*(self.path.spline(grid.elapsed_s, order) for order in range(3))),
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
