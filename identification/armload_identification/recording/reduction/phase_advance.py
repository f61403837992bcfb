"""Phase of a run along its excitation: its whole periods, and where it advanced uniformly in time.

The recording contains the phase of every sample. The duration of a period is nevertheless measured from the time
stamps, cycles may be missing, and only whole periods are used.

A pause or another speed interrupts the measured periods: the recorder gives these rows no phase, and time passes by
more than the phase advances. The stretches between interruptions are at full speed and sampled at the same phases, so
that all of them count. What is missing is missing in one period, and the other periods have it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.recording import Recording

_ABSENT: Final = 1e-6
"""A harmonic below this share of the greatest is treated as absent."""
_FEWEST: Final = 8
"""Least number of phases per period, however slowly it was sampled."""
SETTLING_S: Final = 0.3
"""Start of a run that is left out of its average period: the arm enters the excitation with another acceleration, so
that its servos' lag differs by up to 3 mrad on `er50`. In the average this was a jump from the period's end to its
start, which looked like an impact."""
_UNEVEN: Final = 0.02
"""Allowed deviation of the phase from a uniform advance, as a share of a period; a longer delay is an interruption, and
in a gap also a delay by this share of the gap: 90 % of the speed for a second leave a gap of a second."""
_GAP: Final = 5.0
"""Samples from which a part of the phase without rows is a gap; single rows are missing in sound runs, too."""
_NOTICED: Final = 1.5
"""Samples by which the time stamps of a gap's ends must be too far apart, so that their jitter is no interruption."""
_ROUNDING: Final = 1e-6


class PhaseAdvance:
    """Time as a function of phase: lines of the same slope by least squares, one for every stretch of even motion.

    Args:
        phase: First phases of the run, at least two, from which spacing and speed are determined.
        time_s: Their time stamps.
        period_s: Duration of a period.
    """

    def __init__(self, phase: FloatArray, time_s: FloatArray, period_s: float) -> None:
        self._period_s = period_s
        self._spacing_s = float(np.median(np.diff(phase)))
        self._pace = float(np.median(np.diff(time_s))) / self._spacing_s
        self._rate: float | None = None
        self._last_s, self._last_time_s = float(phase[0]), float(time_s[0])
        self._stretches = [_EvenStretch(self._last_s)]

    @classmethod
    def of(cls, phase: FloatArray, time_s: FloatArray, period_s: float) -> PhaseAdvance:
        """The advance of a complete run.

        Args:
            phase: (N,) its phases, at least two.
            time_s: (N,) their time stamps.
            period_s: Duration of a period.
        """
        advance = cls(phase, time_s, period_s)
        advance.add(phase, time_s)
        return advance

    def add(self, phase: FloatArray, time_s: FloatArray) -> FloatArray:
        """Add more samples.

        Args:
            phase: (N,) the next phases.
            time_s: (N,) their time stamps.

        Returns:
            (N,) phase since the beginning of each sample's stretch.
        """
        further_s = np.diff(phase, prepend=self._last_s)
        lost_s = np.diff(time_s, prepend=self._last_time_s) - self._pace * further_s
        noticed_s = np.maximum(_UNEVEN * further_s, _NOTICED * self._spacing_s) * self._pace
        gap = (further_s > _GAP * self._spacing_s) & (lost_s > noticed_s)
        starts = np.flatnonzero((further_s > 0.0) & (gap | (lost_s > _UNEVEN * self._period_s))).tolist()
        since_s = np.empty_like(phase)
        for number, (begin, end) in enumerate(pairwise([0, *starts, phase.size])):
            if number:
                self._stretches.append(_EvenStretch(float(phase[begin])))
            if begin < end:
                rows, stretch = slice(begin, end), self._stretches[-1]
                self._rate = stretch.add(phase[rows], time_s[rows], self._rate)
                since_s[rows] = phase[rows] - stretch.first_s
        self._last_s, self._last_time_s = float(phase[-1]), float(time_s[-1])
        return since_s

    @property
    def interruptions(self) -> int:
        """How often the run was paused or slowed down within its periods."""
        return len(self._stretches) - 1

    @property
    def rate(self) -> float:
        """Measured seconds per second of phase; 0 if it cannot be determined."""
        square = sum(stretch.phase_square for stretch in self._stretches)
        return sum(stretch.product for stretch in self._stretches) / square if square > 0.0 else 0.0

    @property
    def is_even(self) -> bool:
        """Whether the phase advanced uniformly in all stretches, at the same speed."""
        return self.rate > 0.0 and self._uneven_s() <= _UNEVEN * self._period_s

    @property
    def held(self) -> int:
        """Number of whole periods from the first to the last phase."""
        return whole_between(self._stretches[0].first_s, self._last_s, self._spacing_s, self._period_s)

    @property
    def periods(self) -> int:
        """Number of whole periods; of an interrupted run, how often its least measured phase was measured.

        The time in which the arm settles after an interruption does not count. That after the start does, as in a run
        without interruptions.
        """
        if not self.interruptions:
            return self.held
        first_s = self._stretches[0].first_s
        phases = max(round(self._period_s / self._spacing_s), 1)
        count = np.zeros(phases, dtype=np.int64)
        for stretch in self._stretches:
            settled_s = stretch.first_s + (SETTLING_S if stretch is not self._stretches[0] else 0.0)
            begin = math.ceil((settled_s - first_s) / self._spacing_s - _ROUNDING)
            end = min(round((stretch.last_s - first_s) / self._spacing_s) + 1, self.held * phases)
            complete, rest = divmod(max(end - begin, 0), phases)
            count += complete
            count[(begin + np.arange(rest)) % phases] += 1
        return int(count.min())

    def require_even(self, path: Path) -> None:
        """Raise if the run's phase did not advance uniformly, or nowhere over a whole period.

        Args:
            path: Name of the run in the message.

        Raises:
            RecordingError: the run was paused or changed its speed.
        """
        if not self.is_even:
            raise RecordingError(
                f"{path}: the phase is up to {self._uneven_s():.3g} s off a uniform advance, "
                f"{_UNEVEN * self._period_s:.3g} s is allowed. The run was paused or changed its speed within the "
                "periods: record it again."
            )
        if self.interruptions and not self.periods:
            raise RecordingError(
                f"{path}: the run was paused or slowed down within its periods, and a part of the period was never "
                "measured at full speed. Record it again."
            )

    def time_at(self, phase: FloatArray) -> FloatArray:
        """Times on the first stretch's line."""
        first = self._stretches[0]
        return np.asarray(first.time_s + self.rate * (phase - first.phase_s))

    def _uneven_s(self) -> float:
        """Greatest distance of a time stamp from its stretch's line."""
        rate = self.rate
        return max(stretch.uneven_s(rate) for stretch in self._stretches)


@dataclass
class _EvenStretch:
    """Sums over a stretch, and the samples that may be farthest from its line."""

    first_s: float
    last_s: float = 0.0
    n: int = 0
    phase_s: float = 0.0
    time_s: float = 0.0
    phase_square: float = 0.0
    product: float = 0.0
    extremes: list[tuple[float, float]] = field(default_factory=list)

    def add(self, phase: FloatArray, time_s: FloatArray, rate: float | None) -> float | None:
        """Add more samples; returns the approximate rate, from these if it was not known."""
        mean_phase, mean_time = float(phase.mean()), float(time_s.mean())
        centred = phase - mean_phase
        square, product = float(centred @ centred), float(centred @ (time_s - mean_time))
        total = self.n + phase.size
        share = self.n * phase.size / total
        apart_phase, apart_time = mean_phase - self.phase_s, mean_time - self.time_s
        self.phase_square += square + share * apart_phase**2
        self.product += product + share * apart_phase * apart_time
        self.phase_s += apart_phase * phase.size / total
        self.time_s += apart_time * phase.size / total
        self.n = total
        self.last_s = float(phase[-1])
        if rate is None and square > 0.0:
            rate = product / square
        # Within a block the final slope moves no extreme: only the two farthest samples of each block are kept.
        off = (time_s - mean_time) - (rate or 1.0) * centred
        self.extremes += [(float(phase[row]), float(time_s[row])) for row in (np.argmin(off), np.argmax(off))]
        return rate

    def uneven_s(self, rate: float) -> float:
        """Greatest distance of a time stamp from the line."""
        phase, time_s = np.array(self.extremes).T
        return float(np.abs((time_s - self.time_s) - rate * (phase - self.phase_s)).max())


def interruptions(recording: Recording) -> int:
    """How often a run was paused or slowed down within the periods of its excitation."""
    if recording.average is not None:
        return recording.average.interruptions
    if not whole_periods(recording):
        return 0
    return PhaseAdvance.of(*phase_and_time(recording), periodic_phase(recording)[1].period_s).interruptions


def measured_periods(recording: Recording) -> int:
    """Number of whole periods that were measured; of an interrupted run, how often every phase was at least."""
    periods = whole_periods(recording)
    if recording.average is not None or recording.excitation is None or not periods:
        return periods
    return PhaseAdvance.of(*phase_and_time(recording), recording.excitation.trajectory.period_s).periods


def even_advance(phase: FloatArray, time_s: FloatArray, trajectory: FourierTrajectory) -> PhaseAdvance | None:
    """Advance of a run that can be averaged; None if a reader would refuse it.

    Args:
        phase: (N,) phases of a run.
        time_s: (N,) their time stamps.
        trajectory: The series as it was designed.
    """
    if phase.size < 2 or not whole(phase, trajectory.period_s):
        return None
    advance = PhaseAdvance.of(phase, time_s, shortest_period(phase, trajectory).period_s)
    return advance if advance.is_even and advance.periods else None


def whole_periods(recording: Recording) -> int:
    """Number of whole periods in a recording, or in its average; 0 without an excitation."""
    if recording.average is not None:
        return recording.average.periods
    if recording.excitation is None:
        return 0
    phase = phase_and_time(recording)[0]
    return whole(phase, recording.excitation.trajectory.period_s) if phase.size > 1 else 0


def phase_and_time(recording: Recording) -> tuple[FloatArray, FloatArray]:
    """(P,) phases of the rows within the periods, and their time stamps; none without a known excitation."""
    phase = np.full(recording.size, np.nan) if recording.phase_s is None else recording.phase_s
    rows = np.isfinite(phase)
    return phase[rows], recording.time_s[rows]


def periodic_phase(recording: Recording) -> tuple[FloatArray, FourierTrajectory]:
    """Phases within the whole periods, and the trajectory to which they refer.

    Raises:
        RecordingError: no whole period.
    """
    if recording.excitation is None or whole_periods(recording) == 0:
        raise RecordingError(
            f"{recording.source.path}: no whole period of a known excitation. Record at least one period."
        )
    phase = phase_and_time(recording)[0]
    return phase, shortest_period(phase, recording.excitation.trajectory)


def shortest_period(phase: FloatArray, trajectory: FourierTrajectory) -> FourierTrajectory:
    """The same series with its shortest period.

    A series of every g-th harmonic repeats itself g times in its nominal period. With the shortest period, errors that
    recur in each repetition are in every line of the average's spectrum, instead of in every g-th line between lines
    of noise.

    Args:
        phase: Phases of a run; the shorter period must contain a whole number of samples.
        trajectory: The series as it was designed.
    """
    size = np.hypot(trajectory.sin_rad, trajectory.cos_rad).max(axis=0)
    present = np.flatnonzero(size > _ABSENT * size.max()) + 1
    every = math.gcd(_cycles(phase, trajectory), *(int(harmonic) for harmonic in present))
    if every == 1 or size.max() == 0.0:
        return trajectory
    kept = {name: getattr(trajectory, name)[:, every - 1 :: every] for name in ("sin_rad", "cos_rad")}
    return replace(trajectory, base_frequency_hz=trajectory.base_frequency_hz * every, **kept)


def phases_of(phase: FloatArray, trajectory: FourierTrajectory) -> int:
    """Number of phases of an average period: the number of samples per period."""
    return max(_cycles(phase, trajectory), _FEWEST)


def whole(phase: FloatArray, period_s: float) -> int:
    """Number of whole periods in a run's phases.

    Args:
        phase: Phases of a run, at least two.
        period_s: Duration of a period.
    """
    return whole_between(float(phase[0]), float(phase[-1]), float(np.median(np.diff(phase))), period_s)


def whole_between(first_s: float, last_s: float, step_s: float, period_s: float) -> int:
    """Number of whole periods between a first and a last phase."""
    return int((last_s - first_s + step_s) / period_s + 1e-6)


def _cycles(phase: FloatArray, trajectory: FourierTrajectory) -> int:
    """Number of samples in one period."""
    return round(trajectory.period_s / float(np.median(np.diff(phase))))
