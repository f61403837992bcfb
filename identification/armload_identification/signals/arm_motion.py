"""What one run says of an arm: its motion and its joint torque, over the average period or over the whole run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.body_fit import ArmSamples
from armload_identification.recording.recording import Recording
from armload_identification.signals.alignment import fit_motion
from armload_identification.signals.joint_torque import (
    Transmission,
    joint_torque,
    low_pass,
    motion_earlier,
    smooth,
    smoothing_loss,
    white_noise,
)
from armload_identification.signals.load_signal import (
    ABOVE_BAND,
    SCATTER,
    LoadSignal,
    low_pass_cutoff,
    moving_part,
    one_sample_noise,
    require_motion,
)
from armload_identification.signals.periods import fold, phases_per_period, whole_periods


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """Motion and torque of a run, K equidistant samples of n joints.

    Attributes:
        time_s: (K,) time since the start of the period or of the run.
        periodic: The last sample is followed by the first.
        position_rad: (K, n) fitted to the measured position.
        velocity_rad_s: (K, n) its analytic derivative.
        acceleration_rad_s2: (K, n) its second derivative.
        raw_nm: (K, n) measured joint torque, averaged over the periods where there are some.
        torque_nm: (K, n) the same, smoothed.
        valid: (K,) samples to use.
        noise_nm: (n,) standard deviation of one raw sample.
        averaged_noise_nm: (n,) what is left of it in `raw_nm`.
        noise_source: Where the noise was taken from.
        smoothing_loss: (n,) share of the RMS lost by smoothing.
        periods: Whole periods averaged; 1 without a period.
        position_fit_rad: (n,) RMS of the measured position about the fitted one.
    """

    time_s: FloatArray
    periodic: bool
    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    raw_nm: FloatArray
    torque_nm: FloatArray
    valid: NDArray[np.bool_]
    noise_nm: FloatArray
    averaged_noise_nm: FloatArray
    noise_source: str
    smoothing_loss: FloatArray
    periods: int
    position_fit_rad: FloatArray

    def with_delay(self, delay_s: float) -> ArmMotion:
        """The same torque with the motion that it belongs to.

        Args:
            delay_s: By how much later than positions the drives tell torques.
        """
        position, velocity, acceleration = motion_earlier(
            self.position_rad,
            self.velocity_rad_s,
            self.acceleration_rad_s2,
            float(self.time_s[1] - self.time_s[0]),
            delay_s,
        )
        return replace(self, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration)

    @property
    def samples(self) -> ArmSamples:
        """As the fit of a body takes it."""
        return ArmSamples(
            float(self.time_s[1] - self.time_s[0]),
            self.position_rad,
            self.velocity_rad_s,
            self.acceleration_rad_s2,
            self.torque_nm,
            self.valid,
            self.averaged_noise_nm,
        )


def arm_motion(recording: Recording, transmission: Transmission) -> ArmMotion:
    """Motion and torque of one run.

    Args:
        recording: The run.
        transmission: Gains and coupling.

    Returns:
        The average period of a run with whole periods of a known excitation, else the whole of it.

    Raises:
        RecordingError: a run without motion, too short, or without torque.
    """
    require_motion(recording)
    return _by_period(recording, transmission) if whole_periods(recording) else _as_it_is(recording, transmission)


def without_body(motion: ArmMotion, body_nm: FloatArray) -> LoadSignal:
    """The torque of a loaded run less that of the empty arm.

    Args:
        motion: The loaded run.
        body_nm: (K, n) torque of the empty arm on the same motion, friction included.

    Returns:
        What `load_signal` makes of two runs; the noise is that of one.
    """
    return LoadSignal(
        time_s=motion.time_s,
        periodic=motion.periodic,
        position_rad=motion.position_rad,
        velocity_rad_s=motion.velocity_rad_s,
        acceleration_rad_s2=motion.acceleration_rad_s2,
        raw_nm=motion.raw_nm - body_nm,
        torque_nm=motion.torque_nm - body_nm,
        unloaded_nm=body_nm,
        valid=motion.valid,
        noise_nm=motion.noise_nm,
        averaged_noise_nm=motion.averaged_noise_nm,
        noise_source=motion.noise_source,
        smoothing_loss=motion.smoothing_loss,
        periods=(motion.periods, 0),
        mismatch_rad=np.zeros_like(motion.position_fit_rad),
        position_fit_rad=motion.position_fit_rad,
        shift_s=0.0,
    )


def _by_period(recording: Recording, transmission: Transmission) -> ArmMotion:
    """Over the average period."""
    torque = joint_torque(recording, transmission)
    phases = phases_per_period(recording)
    run = fold(recording, torque, phases)
    time_s = np.arange(phases, dtype=np.float64) * (run.period_s / phases)
    state = run.motion.evaluate(time_s)
    smoothed = smooth(run.torque_nm)
    noise = one_sample_noise(run, torque)
    return ArmMotion(
        time_s=time_s,
        periodic=True,
        position_rad=smooth(state.position_rad),
        velocity_rad_s=smooth(state.velocity_rad_s),
        acceleration_rad_s2=smooth(state.acceleration_rad_s2),
        raw_nm=run.torque_nm,
        torque_nm=smoothed,
        valid=run.valid,
        noise_nm=noise,
        averaged_noise_nm=noise / np.sqrt(run.periods),
        noise_source=ABOVE_BAND if run.scatter_nm is None else SCATTER,
        smoothing_loss=smoothing_loss(run.torque_nm, smoothed),
        periods=run.periods,
        position_fit_rad=run.position_fit_rad,
    )


def _as_it_is(recording: Recording, transmission: Transmission) -> ArmMotion:
    """Over the whole run, on an equidistant grid."""
    run = moving_part(recording)
    motion = fit_motion(run.time_s, run.position_rad)
    interval_s = float(np.median(np.diff(run.time_s)))
    time_s = np.arange(int(motion.duration_s / interval_s), dtype=np.float64) * interval_s
    velocity = motion.spline.derivative()(time_s)
    cutoff_hz = low_pass_cutoff(velocity, interval_s)
    measured = joint_torque(run, transmission)
    moment_s = time_s + run.time_s[0]
    raw = np.column_stack([np.interp(moment_s, run.time_s, column) for column in measured.T])
    smoothed = low_pass(raw, interval_s, cutoff_hz)
    noise = white_noise(measured)
    after = np.clip(np.searchsorted(run.time_s, moment_s), 1, run.time_s.size - 1)
    return ArmMotion(
        time_s=time_s,
        periodic=False,
        position_rad=motion.spline(time_s),
        velocity_rad_s=velocity,
        acceleration_rad_s2=motion.spline.derivative(2)(time_s),
        raw_nm=raw,
        torque_nm=smoothed,
        valid=run.time_s[after] - run.time_s[after - 1] <= 0.25 / cutoff_hz,
        noise_nm=noise,
        averaged_noise_nm=noise,
        noise_source=ABOVE_BAND,
        smoothing_loss=smoothing_loss(raw, smoothed),
        periods=1,
        position_fit_rad=motion.fit_rad,
    )
