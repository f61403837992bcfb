"""The payload's torque: that of a loaded run minus that of an unloaded run of the same motion.

The arm's links and nearly all friction are the same in both runs and cancel, so that no body model is needed. If both
recordings contain whole periods of a known excitation, they are compared phase by phase; otherwise they are aligned by
position, and both are sampled at the same positions of the motion.

The two motions always differ slightly. Their difference is reported; runs of different trajectories are refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.recording.recording import Recording
from armload_identification.signals.filters import low_pass, low_pass_cutoff
from armload_identification.signals.motion import ABOVE_BAND, SCATTER, Motion
from armload_identification.signals.recorded_run import Grid, Run
from armload_identification.signals.signal_constants import RunAlignment, SamePath
from armload_identification.signals.spline import MeasuredMotion


@dataclass(frozen=True, eq=False)
class LoadSignal:
    """Torque difference of two runs at the samples of the loaded run's motion, K samples of n joints.

    Attributes:
        loaded: The run with the payload.
        unloaded: The arm without it at the same positions of the motion: a run, or the prediction of an arm model.
        mismatch_rad: (n,) RMS difference of the two measured motions.
        shift_s: Time from the loaded to the unloaded run's samples; 0 if phases were compared.
    """

    loaded: Motion
    unloaded: Motion
    mismatch_rad: FloatArray
    shift_s: float

    @cached_property
    def raw_nm(self) -> FloatArray:
        """(K, n) torque difference, averaged over the periods of a periodic run."""
        return self.loaded.raw_nm - self.unloaded.raw_nm

    @cached_property
    def torque_nm(self) -> FloatArray:
        """(K, n) the same, smoothed; both runs go through the same filter."""
        return self.loaded.torque_nm - self.unloaded.torque_nm

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """(K,) False if a sample of either run was filled in; such samples are not used."""
        return self.loaded.valid & self.unloaded.valid

    @cached_property
    def noise_nm(self) -> FloatArray:
        """(n,) standard deviation of the difference of two RAW samples, one of each run."""
        return np.hypot(self.loaded.noise_nm, self.unloaded.noise_nm)

    @cached_property
    def averaged_noise_nm(self) -> FloatArray:
        """(n,) standard deviation of the noise in `raw_nm`, N m."""
        return np.hypot(self.loaded.averaged_noise_nm, self.unloaded.averaged_noise_nm)

    @cached_property
    def noise_memory(self) -> FloatArray:
        """(L,) autocorrelation of that noise by the lag in samples, from 0."""
        both = self.loaded.noise_memory, self.unloaded.noise_memory
        lags = max(memory.size for memory in both)
        return np.asarray(np.mean([np.pad(memory, (0, lags - memory.size)) for memory in both], axis=0))

    @property
    def noise_source(self) -> str:
        """How the noise was estimated: `SCATTER` only if it was for both runs."""
        return SCATTER if {self.loaded.noise_source, self.unloaded.noise_source} == {SCATTER} else ABOVE_BAND

    @cached_property
    def smoothing_loss(self) -> FloatArray:
        """(n,) share of the RMS lost by smoothing, the greater of the two."""
        return np.maximum(self.loaded.smoothing_loss, self.unloaded.smoothing_loss)

    @cached_property
    def empty_arm(self) -> Motion:
        """The unloaded run, with the noise and validity of the difference."""
        return replace(self.unloaded, valid=self.valid, averaged_noise_nm=self.averaged_noise_nm)

    def raw_residual_rms(self, predicted_nm: FloatArray) -> FloatArray:
        """(n,) RMS in N m of single samples minus (K, n) prediction, comparable with their noise.

        Both refer to the difference of two RAW torque samples, one of each run at the same position of the motion,
        neither averaged nor smoothed: the averages minus the prediction, and the noise that averaging removed.
        """
        averaged = np.mean((self.raw_nm - predicted_nm)[self.valid] ** 2, axis=0)
        return np.asarray(np.sqrt(averaged + self.noise_nm**2 - self.averaged_noise_nm**2))

    def of_both(self, change: Callable[[Motion], Motion]) -> LoadSignal:
        """The same with both runs changed."""
        return replace(self, loaded=change(self.loaded), unloaded=change(self.unloaded))

    def on_one_motion(self, chain: Chain, body: BodyModel) -> LoadSignal:
        """The pair as if the unloaded run had followed the loaded one's motion, with links and rotors of a body.

        A servo sags under load: loaded and unloaded positions are up to 0.4 mrad apart, so that the torque of links and
        rotors differs by

            (1 + mu s sgn tau_links) (tau_links(q_loaded) - tau_links(q_unloaded))
                + C^-T diag(I_r) C^-1 (ddq_loaded - ddq_unloaded).

        Without this correction the mass of 2 kg on a simulated arm of seven joints is 0.08 % off, more than the noise
        of a minute. Friction that changes sign at a reversal is not corrected, as samples there have little weight.
        """
        own, other = self.loaded, self.unloaded
        here, there = (body.link_torque(chain, *run.states) for run in (own, other))
        velocity = own.states.velocity_rad_s
        direction = smooth_sign(velocity, body.reversal_speed_rad_s)
        apart = own.states.acceleration_rad_s2 - other.states.acceleration_rad_s2
        sag_nm = (1.0 + body.load_friction * direction * np.sign(here)) * (here - there) + apart @ body.rotor_mass_kg_m2
        if not own.periodic:
            sag_nm = low_pass(sag_nm, own.interval_s, low_pass_cutoff(velocity, own.interval_s))
        moved = replace(other, states=own.states, raw_nm=other.raw_nm + sag_nm, torque_nm=other.torque_nm + sag_nm)
        return replace(self, unloaded=moved)


def load_signal(loaded: Run, unloaded: Run) -> LoadSignal:
    """Difference of a loaded and an unloaded run of the same motion.

    Raises:
        RecordingError: runs of different trajectories or speeds, or of different arms.
    """
    one, two = loaded.recording, unloaded.recording
    if one.n != two.n:
        raise RecordingError(
            f"{one.source.path} has {one.n} joints, {two.source.path} has {two.n}. Use two runs of the same arm."
        )
    _require_same_excitation(one, two)
    return _by_phase(loaded, unloaded) if loaded.periods and unloaded.periods else _by_position(loaded, unloaded)


def slow_round_signal(loaded: Run, unloaded: Run) -> LoadSignal | None:
    """The same of what two runs recorded before their periods, the slow round; None if it is not the same motion."""
    before = [run.before_periods for run in (loaded, unloaded)]
    try:
        return _by_position(before[0], before[1]) if all(run.recording.size for run in before) else None
    except RecordingError:
        return None


def without_body(motion: Motion, body_nm: FloatArray) -> LoadSignal:
    """Torque of a loaded run minus (K, n) N m of the empty arm with friction, with the noise of one run."""
    nothing = np.zeros(motion.n)
    predicted = replace(
        motion,
        raw_nm=body_nm,
        torque_nm=body_nm,
        noise_nm=nothing,
        averaged_noise_nm=nothing,
        smoothing_loss=nothing,
        periods=0,
        position_fit_rad=nothing,
    )
    return LoadSignal(motion, predicted, mismatch_rad=nothing, shift_s=0.0)


def _by_phase(loaded: Run, unloaded: Run) -> LoadSignal:
    """The difference of two average periods, phase by phase."""
    phases = loaded.phases
    one, two = loaded.motion, unloaded.average_period(phases)
    if abs(one.interval_s / two.interval_s - 1.0) > SamePath.period_share:
        raise RecordingError(
            f"one period took {phases * one.interval_s:.4g} s in {loaded.recording.source.path} and "
            f"{phases * two.interval_s:.4g} s in {unloaded.recording.source.path}. Record both runs at the same speed "
            "and with the same clock."
        )
    return LoadSignal(one, two, _require_same_path(loaded.recording, unloaded.recording, one, two), shift_s=0.0)


def _by_position(loaded: Run, unloaded: Run) -> LoadSignal:
    """The difference of two runs aligned by position, at the loaded run's times."""
    one, two = loaded.moving_part, unloaded.moving_part
    shift_s = _shift_by_phase(one.recording, two.recording)
    if shift_s is None:
        shift_s = time_shift(_long_enough(one), _long_enough(two))
    grid = one.moving_grid(max(0.0, -shift_s), min(one.path.duration_s, two.path.duration_s - shift_s))
    begin_s, end_s = _common_part(one, two, grid, shift_s)
    grid = one.moving_grid(begin_s, end_s)
    motions = one.sampled(grid), two.sampled(grid.later(shift_s))
    mismatch = _require_same_path(loaded.recording, unloaded.recording, *motions)
    return LoadSignal(*motions, mismatch, shift_s + float(two.recording.time_s[0] - one.recording.time_s[0]))


def _long_enough(run: Run) -> MeasuredMotion:
    """The motion of a run that may have something in common with another."""
    path = run.path
    if path.duration_s < RunAlignment.shortest_s:
        raise RecordingError(
            f"{run.recording.source.path}: too short, {path.duration_s:.2g} s of motion; at least "
            f"{RunAlignment.shortest_s:g} s is required, a whole period of the excitation recommended. Record both "
            "runs again, or give longer parts of them."
        )
    return path


def _shift_by_phase(one: Recording, two: Recording) -> float | None:
    """Time from the first run's samples to the second's by their phases; None if one of them has no phase.

    Raises:
        RecordingError: the runs have less than a second of their excitation in common.
    """
    if one.phase_s is None or two.phase_s is None or one.excitation is None or two.excitation is None:
        return None
    begin, end = max(one.phase_s[0], two.phase_s[0]), min(one.phase_s[-1], two.phase_s[-1])
    if end - begin < RunAlignment.shortest_s:
        short = min((one, two), key=lambda run: float(run.phase_s[-1]) if run.phase_s is not None else 0.0)
        cut = ": the file is truncated" if short.source.truncated else ""
        raise RecordingError(
            f"{one.source.path} and {two.source.path} share {max(end - begin, 0.0):.2g} s of their excitation, because "
            f"{short.source.path} ends there{cut}. Record that run again."
        )
    phase = np.linspace(begin, end, RunAlignment.phases)
    later = np.interp(phase, two.phase_s, two.time_s - two.time_s[0])
    return float(np.median(later - np.interp(phase, one.phase_s, one.time_s - one.time_s[0])))


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
    from scipy.fft import next_fast_len

    longest_s = max(first.duration_s, second.duration_s)
    step_s = min(RunAlignment.grid_s, longest_s / RunAlignment.fewest_times)
    grid = np.arange(0.0, longest_s, step_s)
    length = next_fast_len(2 * grid.size, real=True)
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


def _common_part(one: Run, two: Run, grid: Grid, shift_s: float) -> tuple[float, float]:
    """Start and end of the longest part in which both motions agree; the entire grid if that is too short."""
    elapsed = grid.elapsed_s
    position = one.path.spline(elapsed)
    apart = np.abs(position - two.path.spline(elapsed + shift_s))
    alike = (apart <= SamePath.peak_over_rms * _allowed_rad(position)).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], alike, [False]])))
    first, after = edges[::2], edges[1::2]
    end_s = float(elapsed[-1]) + grid.interval_s
    if not first.size:
        return float(elapsed[0]), end_s
    longest = int(np.argmax(after - first))
    stretch = elapsed[first[longest] : after[longest]]
    if stretch[-1] - stretch[0] < max(RunAlignment.shortest_s, SamePath.common_share * (elapsed[-1] - elapsed[0])):
        return float(elapsed[0]), end_s
    return float(stretch[0]), float(stretch[-1]) + grid.interval_s


def _allowed_rad(position: FloatArray) -> FloatArray:
    """(n,) greatest RMS difference of two runs of the same motion."""
    return np.asarray(np.maximum(SamePath.rms_rad, SamePath.rms_share * position.std(axis=0)))


def _require_same_excitation(loaded: Recording, unloaded: Recording) -> None:
    """Raise if the two runs were commanded along different series."""
    if loaded.excitation is None or unloaded.excitation is None:
        return
    one, two = loaded.excitation.trajectory, unloaded.excitation.trajectory
    parts = ("base_frequency_hz", "offset_rad", "sin_rad", "cos_rad")
    pairs = [(getattr(one, name), getattr(two, name)) for name in parts]
    if not all(np.shape(own) == np.shape(other) and np.allclose(own, other) for own, other in pairs):
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} followed different excitations ({one.harmonics} "
            f"harmonics of {one.base_frequency_hz:g} Hz and {two.harmonics} of "
            f"{two.base_frequency_hz:g} Hz). The difference of two runs requires the same motion: use a matching pair "
            "of files."
        )


def _require_same_path(loaded: Recording, unloaded: Recording, one: Motion, two: Motion) -> FloatArray:
    """(n,) RMS difference of the two motions; raises if it is too great for subtracting their torques."""
    known = one.valid & two.valid  # in a gap the motion is not known
    known |= not known.any()
    position = one.states.position_rad[known]
    mismatch = np.asarray(np.sqrt(np.mean((position - two.states.position_rad[known]) ** 2, axis=0)))
    allowed = _allowed_rad(position)
    worst = int(np.argmax(mismatch / allowed))
    if mismatch[worst] > allowed[worst]:
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} are not of the same trajectory: at their best alignment, "
            f"joint {worst + 1} differs by {mismatch[worst]:.3g} rad RMS, {allowed[worst]:.3g} rad is allowed. Use two "
            "runs of the same motion and check the order of the joints; or calibrate "
            "the arm (`armload calibrate`): then the loaded run alone is enough, whatever its motion."
        )
    return mismatch
