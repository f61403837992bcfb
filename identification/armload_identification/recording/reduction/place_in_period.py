"""Position of a run's rows in the periods of its excitation.

The recording contains the phase of every sample. The duration of a period is nevertheless measured from the time
stamps, cycles may be missing, and only whole periods are used.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import FourierTrajectory
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


def whole_periods(recording: Recording) -> int:
    """Number of whole periods in a recording, or in its average; 0 without an excitation."""
    if recording.average is not None:
        return recording.average.periods
    if recording.phase_s is None or recording.excitation is None:
        return 0
    phase = recording.phase_s[np.isfinite(recording.phase_s)]
    return whole(phase, recording.excitation.trajectory.period_s) if phase.size > 1 else 0


def phases_per_period(recording: Recording) -> int:
    """Number of samples in one period of a recording that contains whole periods."""
    phase, trajectory = periodic_phase(recording)
    return phases_of(phase, trajectory)


def periodic_phase(recording: Recording) -> tuple[FloatArray, FourierTrajectory]:
    """Phases within the whole periods, and the trajectory to which they refer.

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
