"""From what the drives tell to joint torque, and the filters that take noise out of it.

Drives see motors; the model sees joints. AXIS is a motor seen through its gear: q_joint = C q_axis and, since
power is the same on both sides, tau_joint = C^-T tau_axis.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, savgol_filter, sosfiltfilt

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError, RecordingError
from armload_identification.recording.recording import Recording

NOMINAL_DEVIATION: Final = 0.02
"""Relative standard deviation that a gain is assumed to have until it is calibrated. On the UR10e the gains that a
regression of the controller's own signals gives put the mass 0.2 to 3 % off."""
SMOOTHING_PASSES: Final = 5
SMOOTHING_LOSS_LIMIT: Final = 0.10
"""Chen 2016: at most this share of a signal's RMS may be lost by smoothing."""
_LOW_PASS_ORDER: Final = 4
_MEDIAN_OF_NORMAL: Final = 0.674490
"""Median of the absolute value of a standard normal variable."""
_THIRD_DIFFERENCE_GAIN: Final = 20.0
"""Variance of a third difference of unit white noise: 1 + 9 + 9 + 1."""


@dataclass(frozen=True, eq=False)
class Transmission:
    """What lies between motor current and joint torque.

    Attributes:
        gain_nm_a: (n,) axis torque per ampere of motor current: torque constant times gear ratio.
        coupling: (n, n) C with q_joint = C q_axis; the identity where no motors are coupled.
        calibrated: (n,) True where a gain was calibrated with a known load and is not nominal; nowhere if not given.
        deviation: (n,) relative standard deviation of each gain; if not given, 0 where it was calibrated and
            `NOMINAL_DEVIATION` where it is nominal.

    Raises:
        ModelError: shapes that do not fit, a gain that is not positive, or a coupling that cannot be inverted.
    """

    gain_nm_a: FloatArray
    coupling: FloatArray
    calibrated: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    deviation: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        gain = np.array(self.gain_nm_a, dtype=np.float64)
        coupling = np.array(self.coupling, dtype=np.float64)
        if gain.ndim != 1 or coupling.shape != (gain.size, gain.size):
            raise ModelError(
                f"gains have the shape {gain.shape} and the coupling {coupling.shape}; expected (n,) and (n, n)"
            )
        if not (np.isfinite(gain).all() and (gain > 0.0).all()):
            raise ModelError(f"gains are {gain.tolist()} N m/A; expected numbers above 0")
        if not np.isfinite(coupling).all() or np.linalg.matrix_rank(coupling) < gain.size:
            raise ModelError(f"the coupling {coupling.tolist()} cannot be inverted; expected q = C q_axis")
        calibrated = np.array(self.calibrated, dtype=bool)
        if calibrated.size == 0:
            calibrated = np.zeros(gain.size, dtype=bool)
        deviation = np.array(self.deviation, dtype=np.float64)
        if deviation.size == 0:
            deviation = np.where(calibrated, 0.0, NOMINAL_DEVIATION)
        if calibrated.shape != gain.shape or deviation.shape != gain.shape:
            raise ModelError(
                f"{calibrated.size} marks of calibration and {deviation.size} deviations for {gain.size} gains; "
                "expected one per gain"
            )
        if not (np.isfinite(deviation).all() and (deviation >= 0.0).all()):
            raise ModelError(f"the gains' relative deviations are {deviation.tolist()}; expected numbers from 0 on")
        calibrated.flags.writeable = False
        deviation.flags.writeable = False
        gain.flags.writeable = False
        coupling.flags.writeable = False
        object.__setattr__(self, "gain_nm_a", gain)
        object.__setattr__(self, "coupling", coupling)
        object.__setattr__(self, "calibrated", calibrated)
        object.__setattr__(self, "deviation", deviation)

    def gain_shares(self, torque_nm: FloatArray) -> FloatArray:
        """How joint torque changes with the logarithm of each gain, C^-T e_a (C^T tau)_a.

        Args:
            torque_nm: (N, n) joint torques.

        Returns:
            (n, N, n) [axis, sample, joint] in N m; their sum over the axes is the torque.
        """
        to_axis = np.linalg.inv(self.coupling)
        return np.asarray((torque_nm @ self.coupling).T[:, :, None] * to_axis[:, None, :])

    def joint_torque(self, current_a: FloatArray) -> FloatArray:
        """Joint torque of measured motor currents, tau = C^-T diag(gain) i.

        Args:
            current_a: (N, n) motor currents.

        Returns:
            (N, n) joint torques in N m.
        """
        return np.asarray(np.linalg.solve(self.coupling.T, (current_a * self.gain_nm_a).T).T)


def joint_torque(recording: Recording, transmission: Transmission) -> FloatArray:
    """Measured joint torque of a recording: told by the drives, else from the motor currents.

    Args:
        recording: The run.
        transmission: Gains and coupling; used for currents only.

    Returns:
        (N, n) joint torques in N m.

    Raises:
        RecordingError: a signal that stands still, or no torque at all.
    """
    if recording.torque_nm is not None:
        torque, name = recording.torque_nm, "torque_nm"
    elif recording.current_a is not None:
        torque, name = transmission.joint_torque(recording.current_a), "current_a"
    else:
        raise RecordingError(f"{recording.source.path}: neither motor current nor joint torque. Record 6078 or 6077.")
    measured = recording.torque_nm if recording.torque_nm is not None else recording.current_a
    if measured is not None and (np.ptp(measured, axis=0) == 0.0).all():
        raise RecordingError(
            f"{recording.source.path}: every column of {name} is constant, so nothing was measured. "
            "Check the mapping of 6077 or 6078, or the column map."
        )
    return torque


def smooth(values: FloatArray) -> FloatArray:
    """Five-point cubic smoothing, five passes.

    Args:
        values: (N, n), N at least 5.

    Returns:
        (N, n) smoothed along the first axis.

    References:
        Chen 2016, eq. (8): with its four rows for the ends, a Savitzky-Golay filter of window 5 and order 3
        with interpolated ends.
    """
    for _ in range(SMOOTHING_PASSES):
        values = savgol_filter(values, 5, 3, axis=0, mode="interp")
    return np.asarray(values)


def smoothing_loss(raw: FloatArray, smoothed: FloatArray) -> FloatArray:
    """Share of each signal's RMS that a filter took away, 1 - RMS(smoothed) / RMS(raw).

    Args:
        raw: (N, n) before.
        smoothed: (N, n) after.

    Returns:
        (n,) between 0 and 1; 0 for a signal that is zero.
    """
    before = np.sqrt(np.mean(raw**2, axis=0))
    after = np.sqrt(np.mean(smoothed**2, axis=0))
    return np.asarray(1.0 - np.divide(after, before, out=np.ones_like(before), where=before > 0.0))


def low_pass(values: FloatArray, interval_s: float, cutoff_hz: float) -> FloatArray:
    """Zero-phase low-pass: a Butterworth filter of order 4, forwards and backwards.

    Args:
        values: (N, n), equidistant.
        interval_s: Time between samples.
        cutoff_hz: Where each of the two passes takes 3 dB.

    Returns:
        (N, n) filtered along the first axis, without delay.
    """
    sections = butter(_LOW_PASS_ORDER, cutoff_hz, fs=1.0 / interval_s, output="sos")
    pad = min(values.shape[0] - 1, int(3.0 / (cutoff_hz * interval_s)))
    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=pad))


def motion_earlier(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, interval_s: float, by_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A smooth motion a little earlier, by its own derivatives.

    Args:
        position: (N, n) in rad, equidistant.
        velocity: (N, n) in rad/s.
        acceleration: (N, n) in rad/s2.
        interval_s: Time between samples.
        by_s: How much earlier; far below the time in which the motion changes.

    Returns:
        Position, velocity and acceleration that much earlier, exact to the square of the time.
    """
    jerk = np.gradient(acceleration, interval_s, axis=0)
    half = 0.5 * by_s**2
    return (
        position - by_s * velocity + half * acceleration,
        velocity - by_s * acceleration + half * jerk,
        acceleration - by_s * jerk,
    )


def white_noise(values: FloatArray) -> FloatArray:
    """Standard deviation of the white noise on every sample, from third differences.

    A third difference removes whatever a cubic over four samples can follow, which is all that an excitation
    contains, and leaves white noise with 20 times its variance. The size is taken from the median, because
    friction at a reversal is sharper than any noise: by the RMS it made the noise of a wrist 1.7 times too large.

    Args:
        values: (N, n) raw samples, N at least 4.

    Returns:
        (n,) standard deviations.
    """
    difference = np.diff(values, n=3, axis=0)
    usual = np.median(np.abs(difference), axis=0) / _MEDIAN_OF_NORMAL
    # A coarsely quantised signal repeats itself so often that its median says nothing.
    spread = np.where(usual > 0.0, usual, np.sqrt(np.mean(difference**2, axis=0)))
    return np.asarray(spread / np.sqrt(_THIRD_DIFFERENCE_GAIN))
