"""Motion and joint torque of one run, at equidistant samples: the type that all estimation starts from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.model.joint_states import JointStates
from armload_identification.signals.reversals import moving_joints, reversal_weights

SCATTER: Final = "scatter between periods"
ABOVE_BAND: Final = "the signal above the motion's band"


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion and torque of one run: K equidistant samples of n joints.

    Attributes:
        time_s: (K,) time since the start of the period, or of the motion.
        periodic: Whether the last sample is followed by the first.
        states: (K, n) each: fitted to the measured position, and its analytic derivatives.
        raw_nm: (K, n) measured joint torque, averaged over the periods of a periodic run.
        torque_nm: (K, n) the same, smoothed: five-point cubic for averages, else a zero-phase low-pass.
        valid: (K,) False if a sample was filled in; such samples are not used.
        noise_nm: (n,) standard deviation of one RAW sample of the torque.
        averaged_noise_nm: (n,) standard deviation in `raw_nm`, after averaging or interpolation.
        noise_source: How the noise was estimated, `SCATTER` or `ABOVE_BAND`.
        smoothing_loss: (n,) share of the RMS lost by smoothing.
        periods: Whole periods averaged; 1 without a period.
        position_fit_rad: (n,) RMS of the measured position about the fitted one.
        began_s: Time stamp of the first sample, or of the first row of periods that were averaged.
        rate: Measured seconds per second of phase; 1 without a period.
        interruptions: How often the run was paused or slowed down within the periods that were averaged.
        noise_memory: (L,) autocorrelation of the noise by the lag in samples, from 0; 1 alone if it counts as white.
    """

    time_s: FloatArray
    periodic: bool
    states: JointStates
    raw_nm: FloatArray
    torque_nm: FloatArray
    valid: NDArray[np.bool_]
    noise_nm: FloatArray
    averaged_noise_nm: FloatArray
    noise_source: str
    smoothing_loss: FloatArray
    periods: int
    position_fit_rad: FloatArray
    began_s: float
    rate: float = 1.0
    interruptions: int = 0
    noise_memory: FloatArray = field(default_factory=lambda: np.ones(1))

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.torque_nm.shape[1])

    @property
    def interval_s(self) -> float:
        """Time between samples."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def moves(self) -> NDArray[np.bool_]:
        """(n,) False for joints at rest."""
        return moving_joints(self.states.position_rad)

    @cached_property
    def reversal_weight(self) -> FloatArray:
        """(K, n) weight of each sample, 0 for joints at rest and at reversals (`reversal_weights`)."""
        return reversal_weights(self.states.position_rad, self.states.velocity_rad_s)

    def with_delay(self, delay_s: float) -> Motion:
        """The same torque with the motion to which it belongs, for torques reported `delay_s` after the positions."""
        return replace(self, states=self.states.earlier(delay_s, self.interval_s))

    def with_torque_times(self, matrix: FloatArray) -> Motion:
        """The same motion with every torque tau replaced by tau M, M (n, n); the noise is not changed."""
        return replace(self, raw_nm=self.raw_nm @ matrix, torque_nm=self.torque_nm @ matrix)

    def turned(self, joints: FloatArray, torques: FloatArray) -> Motion:
        """The same run with positions and their derivatives multiplied by (n, n) `joints`, torques by (n, n) others."""
        states = JointStates(*(values @ joints for values in self.states))
        return replace(self.with_torque_times(torques), states=states)

    def part(self, start_s: float, end_s: float) -> Motion:
        """The samples from one time since the first sample up to, not including, another."""
        rows = slice(*np.searchsorted(self.time_s, [start_s, end_s]))
        return replace(
            self,
            time_s=self.time_s[rows],
            periodic=False,
            states=JointStates(*(values[rows] for values in self.states)),
            raw_nm=self.raw_nm[rows],
            torque_nm=self.torque_nm[rows],
            valid=self.valid[rows],
        )
