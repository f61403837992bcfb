"""What the payload alone did: the torque of a loaded run minus that of an unloaded run of the same motion.

The arm's own links and nearly all friction are in both runs and cancel, so that no body model is needed. Where
both recordings hold whole periods of a known excitation they are averaged over the periods and compared phase
by phase; else they are laid over each other by position, the unloaded torque interpolated at the loaded
run's times.

The two motions are never quite equal. How far they are apart is reported; runs of different trajectories are
refused.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.recording import Recording
from armload_identification.signals.alignment import fit_motion, time_shift
from armload_identification.signals.joint_torque import (
    Transmission,
    joint_torque,
    low_pass,
    motion_earlier,
    smooth,
    smoothing_loss,
    white_noise,
)
from armload_identification.signals.periods import PeriodicRun, fold, phases_per_period, whole_periods

SCATTER: Final = "scatter between periods"
ABOVE_BAND: Final = "the signal above the motion's band"

_SAME_PATH_RAD: Final = 0.01
_SAME_PATH_SHARE: Final = 0.03
"""Two runs are of one trajectory if every joint's RMS difference is below either."""
_SAME_SPEED: Final = 0.02
_STANDING: Final = 0.02
"""Below this share of the greatest speed the arm stands; only what lies between is motion."""
_BAND_POWER: Final = 0.999
_LOW_PASS_BANDS: Final = 8.0
_NO_MOTION_RAD: Final = 0.01


@dataclass(frozen=True, eq=False)
class LoadSignal:
    """Torque difference of two runs over the motion of the loaded one, K samples of n joints.

    Attributes:
        time_s: (K,) time since the start of the period, or of the motion; equidistant.
        periodic: The last sample is followed by the first.
        position_rad: (K, n) fitted to the measured position of the loaded run.
        velocity_rad_s: (K, n) its analytic derivative.
        acceleration_rad_s2: (K, n) its second derivative.
        raw_nm: (K, n) torque difference, averaged over the periods where there are some.
        torque_nm: (K, n) the same, smoothed: five-point cubic on averages, else a zero-phase low-pass.
        unloaded_nm: (K, n) smoothed torque of the unloaded run at the same places of the motion.
        valid: (K,) False where a sample had to be filled in; it is not used.
        noise_nm: (n,) standard deviation of the difference of two RAW samples, one of each run.
        averaged_noise_nm: (n,) what is left of it in `raw_nm`, after averaging or interpolation.
        noise_source: Where that was taken from.
        smoothing_loss: (n,) share of the RMS lost by smoothing, the greater of the two runs.
        periods: Whole periods averaged in the loaded and the unloaded run; (1, 1) without a period.
        mismatch_rad: (n,) RMS difference of the two measured motions.
        position_fit_rad: (n,) RMS of the measured position about the fitted one.
        shift_s: Time from the loaded to the unloaded run's samples; 0 where phases were compared.
    """

    time_s: FloatArray
    periodic: bool
    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    raw_nm: FloatArray
    torque_nm: FloatArray
    unloaded_nm: FloatArray
    valid: NDArray[np.bool_]
    noise_nm: FloatArray
    averaged_noise_nm: FloatArray
    noise_source: str
    smoothing_loss: FloatArray
    periods: tuple[int, int]
    mismatch_rad: FloatArray
    position_fit_rad: FloatArray
    shift_s: float

    @property
    def interval_s(self) -> float:
        """Time between samples."""
        return float(self.time_s[1] - self.time_s[0])

    def with_delay(self, delay_s: float) -> LoadSignal:
        """The same torque with the motion that it belongs to.

        Args:
            delay_s: By how much later than positions the drives tell torques.
        """
        position, velocity, acceleration = motion_earlier(
            self.position_rad, self.velocity_rad_s, self.acceleration_rad_s2, self.interval_s, delay_s
        )
        return replace(self, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration)


def load_signal(loaded: Recording, unloaded: Recording, transmission: Transmission) -> LoadSignal:
    """Difference of a loaded and an unloaded run of the same motion.

    Args:
        loaded: Run with the payload.
        unloaded: Run without it.
        transmission: Gains and coupling of the arm.

    Returns:
        The difference.

    Raises:
        RecordingError: runs without motion, of different trajectories or speeds, or of different arms.
    """
    if loaded.n != unloaded.n:
        raise RecordingError(
            f"{loaded.source.path} has {loaded.n} joints, {unloaded.source.path} has {unloaded.n}. "
            "Give two runs of the same arm."
        )
    for run in (loaded, unloaded):
        require_motion(run)
    if whole_periods(loaded) and whole_periods(unloaded):
        _require_same_excitation(loaded, unloaded)
        return _by_phase(loaded, unloaded, transmission)
    return _by_position(moving_part(loaded), moving_part(unloaded), transmission)


def _by_phase(loaded: Recording, unloaded: Recording, transmission: Transmission) -> LoadSignal:
    """Phase by phase over the average period."""
    phases = phases_per_period(loaded)
    torque = [joint_torque(run, transmission) for run in (loaded, unloaded)]
    runs = [fold(run, tau, phases) for run, tau in zip((loaded, unloaded), torque, strict=True)]
    if abs(runs[0].period_s / runs[1].period_s - 1.0) > _SAME_SPEED:
        raise RecordingError(
            f"one period took {runs[0].period_s:.4g} s in {loaded.source.path} and {runs[1].period_s:.4g} s in "
            f"{unloaded.source.path}. Record both runs at the same speed."
        )
    share = np.arange(phases) / phases
    state = runs[0].motion.evaluate(share * runs[0].period_s)
    other = runs[1].motion.evaluate(share * runs[1].period_s)
    mismatch = _rms(state.position_rad - other.position_rad)
    _require_same_path(loaded, unloaded, mismatch, state.position_rad)
    noise = [one_sample_noise(run, tau) for run, tau in zip(runs, torque, strict=True)]
    smoothed = [smooth(run.torque_nm) for run in runs]
    losses = [smoothing_loss(run.torque_nm, after) for run, after in zip(runs, smoothed, strict=True)]
    scattered = all(run.scatter_nm is not None for run in runs)
    return LoadSignal(
        time_s=share * runs[0].period_s,
        periodic=True,
        position_rad=smooth(state.position_rad),
        velocity_rad_s=smooth(state.velocity_rad_s),
        acceleration_rad_s2=smooth(state.acceleration_rad_s2),
        raw_nm=runs[0].torque_nm - runs[1].torque_nm,
        torque_nm=smoothed[0] - smoothed[1],
        unloaded_nm=smoothed[1],
        valid=runs[0].valid & runs[1].valid,
        noise_nm=np.hypot(noise[0], noise[1]),
        averaged_noise_nm=np.hypot(noise[0] / np.sqrt(runs[0].periods), noise[1] / np.sqrt(runs[1].periods)),
        noise_source=SCATTER if scattered else ABOVE_BAND,
        smoothing_loss=np.maximum(losses[0], losses[1]),
        periods=(runs[0].periods, runs[1].periods),
        mismatch_rad=mismatch,
        position_fit_rad=runs[0].position_fit_rad,
        shift_s=0.0,
    )


def _by_position(loaded: Recording, unloaded: Recording, transmission: Transmission) -> LoadSignal:
    """Laid over each other by position, on an equidistant grid of the loaded run's time."""
    motions = [fit_motion(run.time_s, run.position_rad) for run in (loaded, unloaded)]
    shift_s = time_shift(motions[0], motions[1])
    start_s = max(0.0, -shift_s)
    end_s = min(motions[0].duration_s, motions[1].duration_s - shift_s)
    interval_s = float(np.median(np.diff(loaded.time_s)))
    time_s = start_s + np.arange(int((end_s - start_s) / interval_s)) * interval_s
    speed = np.abs(motions[0].spline.derivative()(time_s)).max(axis=1)
    moving = np.flatnonzero(speed > _STANDING * speed.max())
    time_s = time_s[moving[0] : moving[-1] + 1]
    position = motions[0].spline(time_s)
    mismatch = _rms(position - motions[1].spline(time_s + shift_s))
    _require_same_path(loaded, unloaded, mismatch, position)
    velocity = motions[0].spline.derivative()(time_s)
    cutoff_hz = low_pass_cutoff(velocity, interval_s)
    raw, smoothed, noise, kept, losses, holes = [], [], [], [], [], []
    for run, moment_s in ((loaded, time_s + loaded.time_s[0]), (unloaded, time_s + shift_s + unloaded.time_s[0])):
        measured = joint_torque(run, transmission)
        inside = (run.time_s >= moment_s[0]) & (run.time_s <= moment_s[-1])
        noise.append(white_noise(measured[inside]))
        raw.append(np.column_stack([np.interp(moment_s, run.time_s, column) for column in measured.T]))
        smoothed.append(low_pass(raw[-1], interval_s, cutoff_hz))
        losses.append(smoothing_loss(raw[-1], smoothed[-1]))
        after = np.clip(np.searchsorted(run.time_s, moment_s), 1, run.time_s.size - 1)
        share = np.clip((moment_s - run.time_s[after - 1]) / np.diff(run.time_s)[after - 1], 0.0, 1.0)
        # Interpolation averages two samples, and so takes away some of their noise.
        kept.append(noise[-1] * np.sqrt(np.mean((1.0 - share) ** 2 + share**2)))
        holes.append(run.time_s[after] - run.time_s[after - 1] > 0.25 / cutoff_hz)
    return LoadSignal(
        time_s=time_s - time_s[0],
        periodic=False,
        position_rad=position,
        velocity_rad_s=velocity,
        acceleration_rad_s2=motions[0].spline.derivative(2)(time_s),
        raw_nm=raw[0] - raw[1],
        torque_nm=smoothed[0] - smoothed[1],
        unloaded_nm=smoothed[1],
        valid=~(holes[0] | holes[1]),
        noise_nm=np.hypot(noise[0], noise[1]),
        averaged_noise_nm=np.hypot(kept[0], kept[1]),
        noise_source=ABOVE_BAND,
        smoothing_loss=np.maximum(losses[0], losses[1]),
        periods=(1, 1),
        mismatch_rad=mismatch,
        position_fit_rad=motions[0].fit_rad,
        shift_s=shift_s + float(unloaded.time_s[0] - loaded.time_s[0]),
    )


def moving_part(run: Recording) -> Recording:
    """The run without approach and return, where its phase tells them; else all of it.

    Args:
        run: The run.
    """
    if run.phase_s is None or np.count_nonzero(np.isfinite(run.phase_s)) < 2:
        return run
    rows = np.isfinite(run.phase_s)
    return Recording(
        time_s=run.time_s[rows],
        position_rad=run.position_rad[rows],
        velocity_rad_s=None if run.velocity_rad_s is None else run.velocity_rad_s[rows],
        current_a=None if run.current_a is None else run.current_a[rows],
        torque_nm=None if run.torque_nm is None else run.torque_nm[rows],
        phase_s=run.phase_s[rows],
        excitation=run.excitation,
        source=run.source,
    )


def one_sample_noise(run: PeriodicRun, torque_nm: FloatArray) -> FloatArray:
    """(n,) noise of one raw sample: from the scatter between periods where there is one, else from the signal itself.

    Args:
        run: The folded run.
        torque_nm: (N, n) its torque before folding.
    """
    return white_noise(torque_nm) if run.scatter_nm is None else run.scatter_nm


def require_motion(run: Recording) -> None:
    """Refuse a run in which the arm stands still.

    Args:
        run: The run.

    Raises:
        RecordingError: no joint moves.
    """
    if (np.ptp(run.position_rad, axis=0) < _NO_MOTION_RAD).all():
        raise RecordingError(
            f"{run.source.path}: no joint moves more than {_NO_MOTION_RAD} rad, so nothing can be told. "
            "Record a run along an excitation, and check the position columns."
        )


def low_pass_cutoff(velocity: FloatArray, interval_s: float) -> float:
    """Cutoff in Hz of the low-pass for a motion: a multiple of the band in which nearly all of its power lies.

    Args:
        velocity: (K, n) equidistant velocities in rad/s.
        interval_s: Time between samples.
    """
    power = np.sum(np.abs(np.fft.rfft(velocity * np.hanning(velocity.shape[0])[:, None], axis=0)) ** 2, axis=1)
    total = np.cumsum(power)
    index = int(np.searchsorted(total, _BAND_POWER * total[-1]))
    band_hz = float(np.fft.rfftfreq(velocity.shape[0], interval_s)[index])
    return min(max(_LOW_PASS_BANDS * band_hz, 2.0), 0.25 / interval_s)


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _require_same_excitation(loaded: Recording, unloaded: Recording) -> None:
    """Raise where the two runs were sent along different series."""
    if loaded.excitation is None or unloaded.excitation is None:
        return
    one, two = loaded.excitation.trajectory, unloaded.excitation.trajectory
    if not _equal(one, two):
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} were sent along different excitations "
            f"({one.harmonics} harmonics of {one.base_frequency_hz:g} Hz and {two.harmonics} of "
            f"{two.base_frequency_hz:g} Hz). The difference of two runs needs the same motion: pair the right files."
        )


def _equal(one: FourierTrajectory, two: FourierTrajectory) -> bool:
    return (
        one.sin_rad.shape == two.sin_rad.shape
        and bool(np.isclose(one.base_frequency_hz, two.base_frequency_hz))
        and np.allclose(one.offset_rad, two.offset_rad)
        and np.allclose(one.sin_rad, two.sin_rad)
        and np.allclose(one.cos_rad, two.cos_rad)
    )


def _require_same_path(loaded: Recording, unloaded: Recording, mismatch: FloatArray, position: FloatArray) -> None:
    """Raise where the measured motions differ too much for their torques to be subtracted."""
    allowed = np.maximum(_SAME_PATH_RAD, _SAME_PATH_SHARE * position.std(axis=0))
    worst = int(np.argmax(mismatch / allowed))
    if mismatch[worst] > allowed[worst]:
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} are not of the same trajectory: joint {worst + 1} "
            f"differs by {mismatch[worst]:.3g} rad RMS, allowed is {allowed[worst]:.3g} rad. "
            "Pair two runs of one excitation, and check the order of the joints."
        )
