"""Recordings of a seed: whole periods of a steady motion with its drives' noise, units and gains."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armload_core.arrays import FloatArray
from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.simulation.mujoco_plant import NOISE_CYCLE_S
from armload_identification.excitation.fourier import Excitation
from armload_identification.recording.recording import Recording, RecordingSource
from benchmarks.steady_state import SteadyPeriod


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


def record(
    period: SteadyPeriod,
    scales: DriveScales,
    periods: int,
    rng: np.random.Generator,
    gain_error: FloatArray,
    noise_scale: float = 1.0,
) -> Recording:
    """A run of whole periods.

    Args:
        period: The steady motion.
        scales: Units and noise of the drives.
        periods: M.
        rng: Draws the noise, white, sigma = noise at 100 Hz * sqrt(rate / 100 Hz).
        gain_error: (n,) e; the motor gives 1 + e times the torque that the drive reports.
        noise_scale: Factor on the noise and on the drives' unit of effort, to see what remains without them.
            Both, because quantisation averages out only with noise.

    Returns:
        The recording, as it would be read from a file.
    """
    n, samples = scales.n, period.samples * periods
    sigma = noise_scale * scales.noise_nm * np.sqrt(NOISE_CYCLE_S / period.sample_s)
    torque = rng.standard_normal((samples, n))
    torque *= sigma
    torque += np.tile(period.axis_torque_nm[:, :n] / (1.0 + gain_error), (periods, 1))
    effort = np.rint(torque * (scales.effort_units_per_nm / noise_scale)) * noise_scale * scales.effort_per_unit
    counts = np.rint(period.axis_position_rad[:, :n] * scales.counts_per_rad)
    position = (counts / scales.counts_per_rad) @ scales.coupling.T
    tells_current = scales.feedback is EffortFeedback.CURRENT
    time_s = np.arange(samples, dtype=np.float64) * np.float64(period.sample_s)
    # Nothing is read back from a file, so a unique name serves as the hash.
    name = f"seeded {rng.integers(2**62):x}"
    return Recording(
        time_s=time_s,
        position_rad=np.tile(position, (periods, 1)),
        velocity_rad_s=None,
        current_a=effort if tells_current else None,
        torque_nm=None if tells_current else effort @ np.linalg.inv(scales.coupling),
        phase_s=time_s + period.sample_s,
        excitation=Excitation(period.trajectory, periods),
        source=RecordingSource(Path(name), name, "mcap", samples, 0, {}),
    )
