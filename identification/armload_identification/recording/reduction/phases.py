"""Where the rows of a run lie in the periods of its excitation.

The recording holds the phase of every sample. What was asked for is not taken for granted: the duration of a
period is measured from the time stamps, cycles may be missing, and only whole periods count.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.recording import Recording

_ABSENT: Final = 1e-6
"""A harmonic below this share of the greatest counts as absent."""
_UNEVEN: Final = 0.02
"""The phase may be this share of a period off an even advance."""
_FEWEST: Final = 8
"""Phases of a period, however slowly it was sampled."""


def whole_periods(recording: Recording) -> int:
    """Whole periods of the motion that a recording holds or is the average of; 0 where it has no excitation.

    Args:
        recording: The run.
    """
    if recording.average is not None:
        return recording.average.periods
    if recording.phase_s is None or recording.excitation is None:
        return 0
    phase = recording.phase_s[np.isfinite(recording.phase_s)]
    return whole(phase, recording.excitation.trajectory.period_s) if phase.size > 1 else 0


def phases_per_period(recording: Recording) -> int:
    """Cycles in one period of the motion of a recording that holds whole periods.

    Args:
        recording: The run.
    """
    phase, trajectory = periodic_phase(recording)
    return phases_of(phase, trajectory)


def periodic_phase(recording: Recording) -> tuple[FloatArray, FourierTrajectory]:
    """Phases inside the whole periods, and the trajectory they belong to.

    Args:
        recording: The run.

    Raises:
        RecordingError: no whole period.
    """
    if recording.phase_s is None or recording.excitation is None or whole_periods(recording) == 0:
        raise RecordingError(
            f"{recording.source.path}: no whole period of a known excitation. Record at least one period."
        )
    phase = recording.phase_s[np.isfinite(recording.phase_s)]
    return phase, shortest_period(phase, recording.excitation.trajectory)


def shortest_period(phase: FloatArray, trajectory: FourierTrajectory) -> FourierTrajectory:
    """The same series with its own, shortest period.

    A series that holds every g-th harmonic only repeats itself g times in what was called its period: whatever errs
    alike in each repetition is then in every line of the spectrum of the average, and not in every g-th alone, between
    lines that hold noise.

    Args:
        phase: Phases of a run; the shorter period must hold a whole number of them.
        trajectory: The series as it was designed.
    """
    size = np.hypot(trajectory.sin_rad, trajectory.cos_rad).max(axis=0)
    present = np.flatnonzero(size > _ABSENT * size.max()) + 1
    every = math.gcd(_cycles(phase, trajectory), *(int(harmonic) for harmonic in present))
    if every == 1 or size.max() == 0.0:
        return trajectory
    return FourierTrajectory(
        trajectory.base_frequency_hz * every,
        trajectory.offset_rad,
        trajectory.sin_rad[:, every - 1 :: every],
        trajectory.cos_rad[:, every - 1 :: every],
    )


def phases_of(phase: FloatArray, trajectory: FourierTrajectory) -> int:
    """Phases that a period is averaged at: as many as it was sampled at.

    Args:
        phase: Phases of a run.
        trajectory: Its series.
    """
    return max(_cycles(phase, trajectory), _FEWEST)


def whole(phase: FloatArray, period_s: float) -> int:
    """Whole periods that phases, at least two, span.

    Args:
        phase: Phases of a run.
        period_s: Duration of a period.
    """
    return whole_between(float(phase[0]), float(phase[-1]), float(np.median(np.diff(phase))), period_s)


def whole_between(first_s: float, last_s: float, step_s: float, period_s: float) -> int:
    """Whole periods between a first and a last phase.

    Args:
        first_s: The first.
        last_s: The last.
        step_s: Between two phases.
        period_s: Duration of a period.
    """
    return int((last_s - first_s + step_s) / period_s + 1e-6)


def require_even(path: Path, uneven_s: float, rate: float, period_s: float) -> None:
    """Refuse a run whose phase did not advance evenly.

    Args:
        path: What the message calls the run.
        uneven_s: Greatest distance of a time stamp from an even advance.
        rate: Measured seconds per second of phase.
        period_s: Duration of a period.

    Raises:
        RecordingError: the run was paused or changed its speed.
    """
    if rate <= 0.0 or uneven_s > _UNEVEN * period_s:
        raise RecordingError(
            f"{path}: the phase is up to {uneven_s:.3g} s off a uniform advance, {_UNEVEN * period_s:.3g} s is "
            "allowed. The run was paused or changed its speed within the periods: record it again."
        )


def _cycles(phase: FloatArray, trajectory: FourierTrajectory) -> int:
    """Cycles in one period."""
    return round(trajectory.period_s / float(np.median(np.diff(phase))))
