"""From reported currents or torques to joint torque; the only place where a current is converted to a torque.

Drives refer to motors, the model to joints. An AXIS is the output side of a motor's gear: q_joint = C q_axis and, as
the power is the same on both sides, tau_joint = C^-T tau_axis.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError, RecordingError
from armload_identification.model.finite_array import finite_array, set_fields
from armload_identification.signals.signal_constants import NominalGain, ReportedTorque

if TYPE_CHECKING:
    from armload_identification.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Transmission:
    """Conversion of motor current to joint torque.

    Attributes:
        gain_nm_a: (n,) axis torque per ampere of motor current: torque constant times gear ratio.
        coupling: (n, n) C with q_joint = C q_axis; the identity if no motors are coupled.
        calibrated: (n,) True if a gain was calibrated with a known load, False if nominal; all False if not given.
        covariance: (n, n) of the logarithms of the gains; if not given, diagonal: 0 for calibrated gains, the square of
            `NominalGain.deviation` for nominal ones.
        torque_gain: (n,) axis torque per N m reported by a drive; 1 if not given.
        scale_deviation: Relative standard deviation of an error that all nominal gains have in common; if not given,
            `NominalGain.common_deviation` for currents and `ReportedTorque.common_deviation` for reported torque.

    Raises:
        ModelError: shapes that do not fit, a gain that is not positive, or a coupling that cannot be inverted.
    """

    gain_nm_a: FloatArray
    coupling: FloatArray
    calibrated: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    torque_gain: FloatArray = field(default_factory=lambda: np.zeros(0))
    scale_deviation: float | None = None
    _from_current: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = np.size(self.gain_nm_a)
        gain = finite_array("gain_nm_a", self.gain_nm_a, (n,), above=0.0)
        coupling = finite_array("coupling", self.coupling, (n, n))
        if np.linalg.matrix_rank(coupling) < n:
            raise ModelError(f"the coupling {coupling.tolist()} cannot be inverted; expected q = C q_axis")
        torque_gain = self.torque_gain if np.size(self.torque_gain) else np.ones(n)
        calibrated = self.calibrated if np.size(self.calibrated) else np.zeros(n)
        calibrated = finite_array("calibrated", calibrated, (n,)).astype(bool)
        nominal = np.diag(np.where(calibrated, 0.0, NominalGain.deviation) ** 2)
        covariance = self.covariance if np.size(self.covariance) else nominal
        arrays: dict[str, NDArray[Any]] = {
            "gain_nm_a": gain,
            "coupling": coupling,
            "calibrated": calibrated,
            "covariance": finite_array("covariance of the gains", covariance, (n, n)),
            "torque_gain": finite_array("torque_gain", torque_gain, (n,), above=0.0),
            "_from_current": gain[:, None] * np.linalg.inv(coupling),
        }
        set_fields(self, arrays)

    def gains(self, *, from_torque: bool) -> Gains:
        """The gains that a recording's torque is computed with.

        Args:
            from_torque: Whether the recording contains torque instead of current.
        """
        value = self.torque_gain if from_torque else self.gain_nm_a
        nominal = not self.calibrated.any() and bool(self.covariance.any())
        common = ReportedTorque.common_deviation if from_torque else NominalGain.common_deviation
        if self.scale_deviation is not None:
            common = self.scale_deviation
        return Gains(value, self.covariance, common if nominal else 0.0, self.calibrated, from_torque, fitted=nominal)

    def held_at(self, gain: FloatArray, covariance: FloatArray) -> Transmission:
        """The same axes with other gains, of currents or of reported torque, which are held fixed in a fit.

        Args:
            gain: (n,) the gains; they are those of the quantity whose present gains they resemble.
            covariance: (n, n) of their logarithms.
        """
        of_current, of_torque = (
            gain if (np.abs(np.log(gain / own)) < ReportedTorque.same_quantity).all() else own
            for own in (self.gain_nm_a, self.torque_gain)
        )
        held = np.ones(gain.size, dtype=bool)
        return replace(self, gain_nm_a=of_current, torque_gain=of_torque, calibrated=held, covariance=covariance)

    def changed_by(self, log_gain: FloatArray) -> FloatArray:
        """Matrix M such that a joint torque tau with these gains is tau M with others.

        Args:
            log_gain: (n,) logarithms of the ratios of the other gains to these.
        """
        return np.asarray((self.coupling * np.exp(log_gain)) @ np.linalg.inv(self.coupling))

    def reported_torque(self, torque_nm: FloatArray) -> FloatArray:
        """Joint torque from reported torques, tau = C^-T diag(gain) C^T tau_reported.

        Args:
            torque_nm: (n,) or (N, n) joint torques as reported.
        """
        if (self.torque_gain == 1.0).all():
            return torque_nm
        return np.asarray((torque_nm @ self.coupling * self.torque_gain) @ np.linalg.inv(self.coupling))

    def joint_torque(self, current_a: FloatArray) -> FloatArray:
        """Joint torque from motor currents, tau = C^-T diag(gain) i.

        Args:
            current_a: (n,) or (N, n) motor currents.

        Returns:
            Joint torques in N m, of the same shape.
        """
        return np.asarray(current_a @ self._from_current)

    def of_effort(self, effort: FloatArray, *, from_torque: bool) -> FloatArray:
        """Joint torques in N m from (n,) or (N, n) efforts: reported torques, or motor currents."""
        return self.reported_torque(effort) if from_torque else self.joint_torque(effort)

    def measured(self, torque_nm: FloatArray | None, current_a: FloatArray | None) -> FloatArray | None:
        """Measured joint torque: from reported torques, else from currents.

        Args:
            torque_nm: (n,) or (N, n) joint torques reported by the drives, or None.
            current_a: (n,) or (N, n) motor currents reported by the drives, or None.

        Returns:
            Joint torques in N m; None if neither was measured.
        """
        if torque_nm is not None:
            return self.reported_torque(torque_nm)
        return None if current_a is None else self.joint_torque(current_a)


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains of n axes.

    Attributes:
        value: (n,) axis torque per ampere or per reported N m.
        own_covariance: (n, n) of their logarithms.
        common_deviation: Standard deviation of an error that all have in common in addition; only a weighed mass shows
            it.
        calibrated: (n,) True for those that were calibrated with a known load.
        from_torque: Whether they are those of reported torque.
        fitted: Whether a pair of runs fits them within this covariance. Calibrated gains are known from more than one
            pair.
    """

    value: FloatArray
    own_covariance: FloatArray
    common_deviation: float
    calibrated: NDArray[np.bool_]
    from_torque: bool
    fitted: bool

    @property
    def covariance(self) -> FloatArray:
        """(n, n) of their logarithms, the common error included."""
        return np.asarray(self.own_covariance + self.common_deviation**2)

    @property
    def errors(self) -> FloatArray:
        """(k, n) logarithms for one standard deviation of each independent error of gains that are not fitted."""
        values, vectors = np.linalg.eigh(self.covariance)
        kept = (values > 0.0) & (not self.fitted)
        return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T)


def gain_shares(torque_nm: FloatArray, coupling: FloatArray) -> FloatArray:
    """Derivative of joint torque by the logarithm of each gain, C^-T e_a (C^T tau)_a.

    Args:
        torque_nm: (N, n) joint torques.
        coupling: (n, n) C of the motors.

    Returns:
        (n, N, n) [axis, sample, joint] in N m; their sum over the axes is the torque.
    """
    return np.asarray((torque_nm @ coupling).T[:, :, None] * np.linalg.inv(coupling)[:, None, :])


def reported_effort(recording: Recording) -> FloatArray:
    """(N, n) columns from which a run's torque is computed: joint torques in N m if reported, else motor currents in A.

    Raises:
        RecordingError: it contains neither.
    """
    effort = recording.effort
    if effort is None:
        raise RecordingError(f"{recording.source.path}: neither motor current nor joint torque. Record 6078 or 6077.")
    return effort


def joint_torque(recording: Recording, transmission: Transmission) -> FloatArray:
    """(N, n) measured joint torque in N m: reported by the drives, else from the motor currents.

    Raises:
        RecordingError: a constant signal, or neither torque nor current.
    """
    effort = reported_effort(recording)
    name = "current_a" if recording.torque_nm is None else "torque_nm"
    if (np.ptp(effort, axis=0) == 0.0).all():
        raise RecordingError(
            f"{recording.source.path}: every column of {name} is constant, so nothing was measured. "
            "Check the mapping of 6077 or 6078, or the column map."
        )
    return transmission.of_effort(effort, from_torque=recording.torque_nm is not None)


def sample_scatter(recording: Recording, transmission: Transmission) -> FloatArray | None:
    """(n,) standard deviation of one raw torque sample between the periods, of a run averaged while it was read."""
    covariance = None if recording.average is None else recording.average.effort_covariance
    if covariance is None:
        return None
    to_joint = transmission.of_effort(np.eye(len(covariance)), from_torque=recording.torque_nm is not None)
    return np.sqrt(np.diag(to_joint.T @ covariance @ to_joint))
