"""A periodic run folded onto one period: average, scatter, and the motion as a Fourier series.

`recording.reduction.phase_advance` determines the position of the rows in a period. A recording that was reduced to
its average period while it was read is processed in the same way, as a single period.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.joint_states import JointStates
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.period_average import ON_GRID
from armload_identification.recording.reduction.phase_advance import SETTLING_S, PhaseAdvance, periodic_phase
from armload_identification.signals.filters import smooth, smoothing_loss, white_noise
from armload_identification.signals.motion import ABOVE_BAND, SCATTER, Motion
from armload_identification.signals.signal_constants import PeriodSeries, SplineFit


def fold(recording: Recording, torque_nm: FloatArray, phases: int, scatter_nm: FloatArray | None = None) -> Motion:
    """Average a periodic run over its periods; its motion passes through the same filter as its torque.

    A series of every g-th harmonic has g periods of the motion itself in each period of the excitation. Phases at which
    no period has a sample are interpolated. The measured position is a Fourier series in time, with analytic
    derivatives.

    Args:
        recording: A run with at least one whole period.
        torque_nm: (N, n) its joint torques.
        phases: K, the number of equidistant phases; phase k is k/K of the period.
        scatter_nm: (n,) standard deviation of ONE raw sample between periods, of a recording that was averaged while it
            was read.

    Returns:
        The folded run.

    Raises:
        RecordingError: no whole period, or a phase that did not advance uniformly.

    References:
        Chen 2016, eqs. (6), (9).
    """
    phase, trajectory = periodic_phase(recording)
    rows = np.isfinite(recording.phase_s) if recording.phase_s is not None else np.empty(0, dtype=bool)
    advance = PhaseAdvance(phase, recording.time_s[rows], trajectory.period_s)
    since_s = advance.add(phase, recording.time_s[rows])
    advance.require_even(recording.source.path)
    step = trajectory.period_s / phases
    values = np.hstack([torque_nm[rows], recording.position_rad[rows]])
    average = recording.average
    held = advance.held if average is None else 1
    if held > 1:
        values[since_s < SETTLING_S] = np.nan
    table = _on_grid(phase / step, values, held, phases)
    count = np.isfinite(table[:, :, 0]).sum(axis=0)
    valid = count > 0
    mean = np.asarray(np.nansum(table, axis=0) / np.maximum(count, 1)[:, None], dtype=np.float64)
    n = recording.n
    motion, misfit = _fit_motion(mean[:, n:], valid, trajectory, advance.rate)
    raw = _filled(mean[:, :n], valid)
    smoothed = smooth(raw)
    counted = average or advance
    scatter = _scatter(table[:, :, :n], mean[:, :n], count) if scatter_nm is None else scatter_nm
    noise = white_noise(torque_nm) if scatter is None else scatter
    period_s = advance.rate * trajectory.period_s
    return Motion(
        time_s=np.arange(phases) / phases * period_s,
        periodic=True,
        states=JointStates(*map(smooth, motion.period(phases)[:3])),
        raw_nm=raw,
        torque_nm=smoothed,
        valid=valid,
        noise_nm=noise,
        averaged_noise_nm=noise / np.sqrt(counted.periods),
        noise_source=ABOVE_BAND if scatter is None else SCATTER,
        smoothing_loss=smoothing_loss(raw, smoothed),
        periods=counted.periods,
        position_fit_rad=misfit,
        began_s=float(recording.time_s[rows][0]),
        rate=advance.rate,
        interruptions=counted.interruptions,
        noise_memory=_memory(table[:, :, :n] - mean[:, :n], period_s / phases),
    )


def _on_grid(place: FloatArray, values: FloatArray, periods: int, phases: int) -> FloatArray:
    """(periods, phases, columns) samples by period and phase, NaN where there is none; phase 0 first."""
    nearest = np.round(place)
    first = int(nearest[0])
    length = periods * phases
    table = np.full((length, values.shape[1]), np.nan)
    offset = place - nearest
    if np.abs(offset - np.median(offset)).max() < ON_GRID:
        index = nearest.astype(np.int64) - first
        inside = index < length
        table[index[inside]] = values[inside]
    else:
        wanted = first + np.arange(length, dtype=np.float64)
        after = np.clip(np.searchsorted(place, wanted), 1, place.size - 1)
        # Without near neighbours on both sides a phase stays empty.
        spacing = float(np.median(np.diff(place)))
        near = place[after] - place[after - 1] < PeriodSeries.neighbours * spacing + PeriodSeries.rounding
        near &= wanted <= place[-1] + PeriodSeries.beyond_the_last * spacing
        for column in range(values.shape[1]):
            table[near, column] = np.interp(wanted[near], place, values[:, column])
    return np.asarray(np.roll(table.reshape(periods, phases, -1), first % phases, axis=1))


def _scatter(table: FloatArray, mean: FloatArray, count: NDArray[np.intp]) -> FloatArray | None:
    """(n,) pooled standard deviation of one sample between the periods."""
    repeated = count > 1
    freedom = int((count[repeated] - 1).sum())
    if freedom < 2:
        return None
    square = np.nansum((table[:, repeated] - mean[repeated]) ** 2, axis=(0, 1))
    return np.asarray(np.sqrt(square / freedom))


def _memory(apart: FloatArray, interval_s: float) -> FloatArray:
    """(L,) autocorrelation of (periods, phases, n) samples minus their average, of all joints together; 1 if alone."""
    if len(apart) < 2:
        return np.ones(1)
    lags = min(round(PeriodSeries.memory_s / interval_s), apart.shape[1] // 2)
    spectrum = np.fft.rfft(np.nan_to_num(apart), 2 * apart.shape[1], axis=1)
    shared = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=0), axis=0)[:lags]
    varies = shared[0] > 0.0
    if not varies.any():
        return np.ones(1)
    faded = 0.5 + 0.5 * np.cos(np.pi * np.arange(lags) / lags)
    return np.asarray(faded * np.mean(shared[:, varies] / shared[0, varies], axis=1))


def _filled(values: FloatArray, valid: NDArray[np.bool_]) -> FloatArray:
    """Values with empty phases filled by periodic interpolation; these are not used in the fit."""
    if valid.all():
        return values
    phases = np.arange(valid.size)
    known = phases[valid]
    return np.column_stack([np.interp(phases, known, column[valid], period=valid.size) for column in values.T])


def _fit_motion(
    position: FloatArray, valid: NDArray[np.bool_], excitation: FourierTrajectory, rate: float
) -> tuple[FourierTrajectory, FloatArray]:
    """Series of the measured position over a period of K phases, and the RMS of its residual.

    The arm does not follow the excitation exactly: friction shakes it at every reversal, on er50 by 17 to 72 urad, with
    accelerations that correspond to 2 N m. The number of harmonics, at least the excitation's, is chosen by generalised
    cross-validation.
    """
    phases = valid.size
    filled = _filled(position, valid)
    for _ in range(1 if valid.all() else PeriodSeries.fillings):
        spectrum = np.fft.rfft(filled, axis=0) / phases
        harmonics = _supported_harmonics(spectrum, excitation.harmonics, phases, rate * excitation.period_s)
        spectrum[harmonics + 1 :] = 0.0
        fitted = np.fft.irfft(spectrum * phases, phases, axis=0)
        # Empty phases are filled from the series, iterated until they no longer affect it.
        filled = np.where(valid[:, None], position, fitted)
    lines = 2.0 * spectrum[1 : harmonics + 1].T
    motion = FourierTrajectory(excitation.base_frequency_hz / rate, spectrum[0].real, -lines.imag, lines.real)
    return motion, np.asarray(np.sqrt(np.mean((position - fitted)[valid] ** 2, axis=0)))


def _supported_harmonics(spectrum: NDArray[np.complex128], least: int, phases: int, period_s: float) -> int:
    """Number of harmonics, at least `least`, by generalised cross-validation."""
    twice = np.full(len(spectrum), 2.0)
    twice[0] = 1.0
    if phases % 2 == 0:
        twice[-1] = 1.0
    power = np.abs(spectrum) ** 2 * twice[:, None]
    usually = 0.5 * PeriodSeries.coefficients_per_sample * phases
    slowly = min(PeriodSeries.at_low_rates_hz * period_s, 0.5 * PeriodSeries.coefficients_at_low_rates * phases)
    harmonics = np.arange(least, max(int(max(usually, slowly)), least + 1))
    left = power.sum(axis=0) - np.cumsum(power, axis=0)[harmonics]
    freedom = 1.0 - (2 * harmonics + 1) / phases
    # The sum of logarithms prevents joints with a large stroke from dominating.
    logarithms = np.log(np.maximum(left, SplineFit.negligible_rad**2))
    penalty = 2.0 * left.shape[1] * np.log(np.maximum(freedom, PeriodSeries.least_freedom))
    return int(harmonics[np.argmin(np.sum(logarithms, axis=1) - penalty)])
