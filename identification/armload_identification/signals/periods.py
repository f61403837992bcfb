"""A periodic run folded onto one period: average, scatter, and the motion as a Fourier series.

The recording tells the phase of every sample. What was asked for is not taken for granted: the duration of a
period is measured from the time stamps, cycles may be missing, and only whole periods count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.recording import Recording

_ABSENT: Final = 1e-6
"""A harmonic below this share of the greatest is not there."""
_ON_GRID: Final = 0.05
"""Samples that lie this close to a common grid, in grid steps, are averaged as they are."""
_FITTED: Final = 0.25
"""At most this share of the samples is taken up by a fit of the motion."""
_FILLINGS: Final = 20
_NOTHING: Final = 1e-18
"""Square of 1 nrad: no encoder tells less."""
_UNEVEN: Final = 0.02
"""The phase may be this share of a period off an even advance."""


@dataclass(frozen=True, eq=False)
class PeriodicRun:
    """One run folded onto one period of K phases, n joints.

    Attributes:
        period_s: Duration of a period by the time stamps.
        periods: Whole periods M that were averaged, of the motion itself: a series of every g-th harmonic has g
            of them in each of the excitation's.
        torque_nm: (K, n) torque averaged over the periods (Chen 2016, eq. (9)).
        valid: (K,) False where no period has a sample; those rows are interpolated.
        scatter_nm: (n,) standard deviation of ONE raw sample between periods; None for one period.
        motion: Measured position as a Fourier series in time, whose derivatives are analytic.
        position_fit_rad: (n,) RMS of the averaged measured position about that series.
    """

    period_s: float
    periods: int
    torque_nm: FloatArray
    valid: NDArray[np.bool_]
    scatter_nm: FloatArray | None
    motion: FourierTrajectory
    position_fit_rad: FloatArray


def whole_periods(recording: Recording) -> int:
    """Whole periods of the excitation that a recording holds; 0 where it has no excitation."""
    if recording.phase_s is None or recording.excitation is None:
        return 0
    phase = recording.phase_s[np.isfinite(recording.phase_s)]
    return _whole(phase, recording.excitation.trajectory.period_s) if phase.size > 1 else 0


def phases_per_period(recording: Recording) -> int:
    """Cycles in one period of the motion of a recording that holds whole periods."""
    phase, trajectory = _phase(recording)
    return max(_phases(phase, trajectory), 8)


def fold(recording: Recording, torque_nm: FloatArray, phases: int) -> PeriodicRun:
    """Average a periodic run over its periods.

    Args:
        recording: A run with at least one whole period.
        torque_nm: (N, n) its joint torques.
        phases: K, the number of equidistant phases; phase k is k/K of the period.

    Returns:
        The folded run.

    Raises:
        RecordingError: no whole period, or a phase that did not advance evenly.

    References:
        Chen 2016, eqs. (6), (9).
    """
    phase, trajectory = _phase(recording)
    rows = np.isfinite(recording.phase_s) if recording.phase_s is not None else np.empty(0, dtype=bool)
    rate = _seconds_per_phase(recording, phase, recording.time_s[rows], trajectory.period_s)
    step = trajectory.period_s / phases
    values = np.hstack([torque_nm[rows], recording.position_rad[rows]])
    table = _on_grid(phase / step, values, _whole(phase, trajectory.period_s), phases)
    count = np.isfinite(table[:, :, 0]).sum(axis=0)
    valid = count > 0
    mean = np.asarray(np.nansum(table, axis=0) / np.maximum(count, 1)[:, None], dtype=np.float64)
    n = recording.n
    motion, misfit = _fit_motion(mean[:, n:], valid, trajectory, rate)
    return PeriodicRun(
        period_s=rate * trajectory.period_s,
        periods=table.shape[0],
        torque_nm=_filled(mean[:, :n], valid),
        valid=valid,
        scatter_nm=_scatter(table[:, :, :n], mean[:, :n], count),
        motion=motion,
        position_fit_rad=misfit,
    )


def _phase(recording: Recording) -> tuple[FloatArray, FourierTrajectory]:
    """Phases inside the whole periods, and the trajectory they belong to.

    A series that holds every g-th harmonic only repeats itself g times in what was called its period. Its own
    period is the shortest: whatever errs alike in each repetition is then in every line of the spectrum of the
    average, and not in every g-th alone, between lines that hold noise.
    """
    if recording.phase_s is None or recording.excitation is None or whole_periods(recording) == 0:
        raise RecordingError(
            f"{recording.source.path}: no whole period of a known excitation. Record at least one period."
        )
    phase, trajectory = recording.phase_s[np.isfinite(recording.phase_s)], recording.excitation.trajectory
    size = np.hypot(trajectory.sin_rad, trajectory.cos_rad).max(axis=0)
    present = np.flatnonzero(size > _ABSENT * size.max()) + 1
    every = math.gcd(_phases(phase, trajectory), *(int(harmonic) for harmonic in present))
    if every == 1 or size.max() == 0.0:
        return phase, trajectory
    shortest = FourierTrajectory(
        trajectory.base_frequency_hz * every,
        trajectory.offset_rad,
        trajectory.sin_rad[:, every - 1 :: every],
        trajectory.cos_rad[:, every - 1 :: every],
    )
    return phase, shortest


def _phases(phase: FloatArray, trajectory: FourierTrajectory) -> int:
    """Cycles in one period."""
    return round(trajectory.period_s / float(np.median(np.diff(phase))))


def _whole(phase: FloatArray, period_s: float) -> int:
    """Whole periods that phases, at least two, span."""
    step_s = float(np.median(np.diff(phase)))
    return int((phase[-1] - phase[0] + step_s) / period_s + 1e-6)


def _seconds_per_phase(recording: Recording, phase: FloatArray, time_s: FloatArray, period_s: float) -> float:
    """Measured seconds per second of phase, by least squares over the run."""
    centred = phase - phase.mean()
    rate = float(centred @ (time_s - time_s.mean()) / (centred @ centred))
    uneven_s = float(np.abs(time_s - time_s.mean() - rate * centred).max())
    if rate <= 0.0 or uneven_s > _UNEVEN * period_s:
        raise RecordingError(
            f"{recording.source.path}: the phase is up to {uneven_s:.3g} s off an even advance, allowed is "
            f"{_UNEVEN * period_s:.3g} s. The run was paused or changed its speed within the periods: record it again."
        )
    return rate


def _on_grid(place: FloatArray, values: FloatArray, periods: int, phases: int) -> FloatArray:
    """(periods, phases, columns) samples by period and phase, NaN where there is none; phase 0 first."""
    nearest = np.round(place)
    first = int(nearest[0])
    length = periods * phases
    table = np.full((length, values.shape[1]), np.nan)
    offset = place - nearest
    if np.abs(offset - np.median(offset)).max() < _ON_GRID:
        index = nearest.astype(np.int64) - first
        inside = index < length
        table[index[inside]] = values[inside]
    else:
        wanted = first + np.arange(length, dtype=np.float64)
        after = np.clip(np.searchsorted(place, wanted), 1, place.size - 1)
        # A neighbour on both sides, no further apart than a sample and a half: else a hole, left empty.
        spacing = float(np.median(np.diff(place)))
        near = (place[after] - place[after - 1] < 1.5 * spacing + 1e-9) & (wanted <= place[-1] + 0.5 * spacing)
        for column in range(values.shape[1]):
            table[near, column] = np.interp(wanted[near], place, values[:, column])
    folded = table.reshape(periods, phases, -1)
    return np.asarray(np.roll(folded, first % phases, axis=1))


def _scatter(table: FloatArray, mean: FloatArray, count: NDArray[np.intp]) -> FloatArray | None:
    """(n,) pooled standard deviation of one sample between the periods."""
    repeated = count > 1
    freedom = int((count[repeated] - 1).sum())
    if freedom < 2:
        return None
    square = np.nansum((table[:, repeated] - mean[repeated]) ** 2, axis=(0, 1))
    return np.asarray(np.sqrt(square / freedom))


def _filled(values: FloatArray, valid: NDArray[np.bool_]) -> FloatArray:
    """Phases without a sample, interpolated over the period's seam; they are not used in the fit."""
    if valid.all():
        return values
    phases = np.arange(valid.size)
    known = phases[valid]
    return np.column_stack([np.interp(phases, known, column[valid], period=valid.size) for column in values.T])


def _fit_motion(
    position: FloatArray, valid: NDArray[np.bool_], excitation: FourierTrajectory, rate: float
) -> tuple[FourierTrajectory, FloatArray]:
    """Series of the measured position over a period of K phases, and the RMS that is left.

    The arm does not follow the excitation exactly: friction shakes it at every reversal, by 17 to 72 urad on er50,
    whose acceleration times the arm's inertia is 2 N m. How many harmonics beyond the excitation's own the positions
    tell of is decided by generalised cross-validation.
    """
    phases = valid.size
    filled = _filled(position, valid)
    for _ in range(1 if valid.all() else _FILLINGS):
        spectrum = np.fft.rfft(filled, axis=0) / phases
        harmonics = _told_harmonics(spectrum, excitation.harmonics, phases)
        spectrum[harmonics + 1 :] = 0.0
        fitted = np.fft.irfft(spectrum * phases, phases, axis=0)
        # What lies in a hole is taken from the series, which the next one is then free to have.
        filled = np.where(valid[:, None], position, fitted)
    motion = FourierTrajectory(
        excitation.base_frequency_hz / rate,
        spectrum[0].real,
        -2.0 * spectrum[1 : harmonics + 1].imag.T,
        2.0 * spectrum[1 : harmonics + 1].real.T,
    )
    return motion, np.asarray(np.sqrt(np.mean((position - fitted)[valid] ** 2, axis=0)))


def _told_harmonics(spectrum: NDArray[np.complex128], least: int, phases: int) -> int:
    """Number of harmonics for which generalised cross-validation is best, from `least` on."""
    twice = np.full(len(spectrum), 2.0)
    twice[0] = 1.0
    if phases % 2 == 0:
        twice[-1] = 1.0
    power = np.abs(spectrum) ** 2 * twice[:, None]
    harmonics = np.arange(least, max(int(0.5 * _FITTED * phases), least + 1))
    left = power.sum(axis=0) - np.cumsum(power, axis=0)[harmonics]
    freedom = 1.0 - (2 * harmonics + 1) / phases
    # One score for all joints, so that no joint's stroke dominates.
    score = np.sum(np.log(np.maximum(left, _NOTHING)), axis=1) - 2.0 * left.shape[1] * np.log(np.maximum(freedom, 0.01))
    return int(harmonics[np.argmin(score)])
