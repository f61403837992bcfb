"""Recordings of a seed: whole periods of a steady motion with its drives' noise, units and gains."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.simulation.mujoco_plant import NOISE_CYCLE_S
from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray
from armload_identification.recording.recording import Recording, RecordingSource
from benchmarks.arms.steady_state import SteadyPeriod

_PAUSE_S = 5.0


@dataclass(frozen=True, eq=False)
class DriveScales:
    """Units of the drives of an arm's first n axes, which are not coupled to the others.

    Attributes:
        coupling: (n, n) C with q_joint = C q_axis.
        counts_per_rad: (n,) of the axes.
        effort_units_per_nm: (n,) reported units per N m of axis torque.
        effort_per_unit: (n,) value of such a unit: motor current in A, or axis torque in N m.
        feedback: Which of the two is reported.
        noise_nm: (n,) standard deviation of one raw sample of axis torque at 100 Hz.
    """

    coupling: FloatArray
    counts_per_rad: FloatArray
    effort_units_per_nm: FloatArray
    effort_per_unit: FloatArray
    feedback: EffortFeedback
    noise_nm: FloatArray

    @classmethod
    def of(cls, arm: ArmSettings, noise_nm: FloatArray, joints: int) -> DriveScales:
        """Scales of the first axes.

        Raises:
            ValueError: one of these axes is coupled to a later one.
        """
        coupling = arm.coupling[:joints, :joints]
        if arm.coupling[:joints, joints:].any() or arm.coupling[joints:, :joints].any():
            raise ValueError(f"the first {joints} axes are coupled with the others and cannot be taken alone")
        units = ArmUnits(arm)
        axes = units.axes[:joints]
        return cls(
            coupling=coupling,
            counts_per_rad=np.array([axis.counts_per_rad for axis in axes]),
            effort_units_per_nm=np.array([axis.effort_units_per_nm for axis in axes]),
            effort_per_unit=np.array([axis.effort_per_unit for axis in axes]),
            feedback=units.feedback,
            noise_nm=noise_nm[:joints],
        )

    @property
    def n(self) -> int:
        """Number of axes."""
        return int(self.noise_nm.size)

    def reported_effort(
        self, axis_torque_nm: FloatArray, sample_s: float, rng: np.random.Generator, noise_scale: float = 1.0
    ) -> tuple[FloatArray | None, FloatArray | None]:
        """(K, n) motor current in A or joint torque in N m, with noise and quantised; None for the other.

        Args:
            axis_torque_nm: (K, n) without noise, as the drives' gains scale it.
            sample_s: Time between samples.
            rng: Draws the noise, white, sigma = noise at 100 Hz * sqrt(rate / 100 Hz).
            noise_scale: Factor on the noise and on the drives' unit of effort, to see what remains without them.
                Both, because quantisation averages out only with noise.
        """
        torque = rng.standard_normal(axis_torque_nm.shape)
        torque *= noise_scale * self.noise_nm * np.sqrt(NOISE_CYCLE_S / sample_s)
        torque += axis_torque_nm
        effort = np.rint(torque * (self.effort_units_per_nm / noise_scale)) * noise_scale * self.effort_per_unit
        if self.feedback is EffortFeedback.CURRENT:
            return effort, None
        return None, effort @ np.linalg.inv(self.coupling)

    def reported_position(self, axis_position_rad: FloatArray) -> FloatArray:
        """(K, n) joint positions in rad, from the counts of the encoders."""
        counts = np.rint(axis_position_rad * self.counts_per_rad)
        return np.asarray((counts / self.counts_per_rad) @ self.coupling.T)


def record(
    period: SteadyPeriod,
    scales: DriveScales,
    periods: int,
    rng: np.random.Generator,
    gain_error: FloatArray,
    noise_scale: float = 1.0,
) -> Recording:
    """A run of whole periods, after the slow round if it was streamed.

    Args:
        period: The steady motion.
        scales: Units and noise of the drives.
        periods: M.
        rng: Draws the noise.
        gain_error: (n,) e; the motor gives 1 + e times the torque that the drive reports.
        noise_scale: As of `DriveScales.reported_effort`.

    Returns:
        The recording, as it would be read from a file.
    """
    n, slow = scales.n, len(period.slow_torque_nm)

    def rows(slowly: FloatArray, steady: FloatArray) -> FloatArray:
        return np.vstack([slowly[:, :n].reshape(-1, n), np.tile(steady[:, :n], (periods, 1))])

    axis_nm = rows(period.slow_torque_nm, period.axis_torque_nm) / (1.0 + gain_error)
    current_a, torque_nm = scales.reported_effort(axis_nm, period.sample_s, rng, noise_scale)
    samples = len(axis_nm)
    # Between both the drives are off.
    time_s = np.asarray(np.arange(samples) * period.sample_s + np.where(np.arange(samples) < slow, 0.0, _PAUSE_S))
    phase_s = (np.arange(samples) - slow + 1) * period.sample_s
    # Nothing is read back from a file, so a unique name serves as the hash.
    name = f"seeded {rng.integers(2**62):x}"
    return Recording(
        time_s=time_s,
        position_rad=scales.reported_position(rows(period.slow_position_rad, period.axis_position_rad)),
        velocity_rad_s=None,
        current_a=current_a,
        torque_nm=torque_nm,
        phase_s=np.where(phase_s > 0.0, phase_s, np.nan),
        excitation=Excitation(period.trajectory, periods),
        source=RecordingSource(Path(name), name, "mcap", samples, {}),
    )
