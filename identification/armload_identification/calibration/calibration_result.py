"""Result of a calibration from many runs: gains, body, friction and tilt of an arm, with their covariance."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.arm_terms import (
    ARM_TERMS,
    COULOMB,
    DELAY,
    GAIN,
    LINKS,
    LOAD_FRICTION,
    ROOT,
    ROTORS,
    TILT,
    VISCOUS,
    known_arm_terms,
    places_of,
)
from armload_identification.estimation.base_tilt import sideways, tilt_axes
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.payload import Provenance
from armload_identification.model.regressor import body_regressor, rotor_columns
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.joint_torque import Transmission, gain_shares
from armload_identification.storage.strict_toml import NumberList, NumberRows, Table, Text

if TYPE_CHECKING:
    from armload_identification.estimation.empty_arm.known_arm import KnownArm
    from armload_identification.model.joint_states import JointStates

DETERMINED_WITHIN: Final = 0.05
"""A gain is determined if the half width of its 95 % interval is at most this share of it."""
COLD: Final = 0.2
"""Relative standard deviation of all friction between days: a cold gear has more than a warm one. It is not visible in
the runs of a calibration, often of one hour, which differ by 2 %."""
_FIRMLY: Final = 100.0
"""How many times more firmly than they are known the arm's values are held while a payload is estimated: estimated
with it, they take up what no term describes, and a payload of another day is 0.7 instead of 0.35 % off."""
_LEAST_POWER: Final = 1e-12
"""Least eigenvalue of the correlation matrix, relative to the greatest, when it is inverted."""
FEWEST_SESSIONS: Final = 3
"""Sessions from which the drift of the gains between them is known."""
_DIGITS: Final = 9
_DAY: Final = 10
"""Characters of a date."""


class CalibratedRun(Table):
    """Residual, friction and influence of one run, as in the calibration's file.

    Attributes:
        name: File name.
        mounting: Name of its payload; empty for an empty arm.
        recorded: Date and time of its start, ISO 8601; empty if neither table nor recording states it.
        residual_rms_nm: (n,) RMS of effort minus prediction, axis torque with nominal gains.
        off: RMS over all joints of that, relative to the noise of all runs: 1 for a typical run.
        friction_changes: (3, n) differences of Coulomb (N m), viscous (N m s/rad) and offset (N m) from all runs.
        influence: (n,) change of each gain without this run, in standard deviations.
        rows: Number of rows used.
        struck: Number of rows excluded as blows to the arm.
        effort_change: Common factor of the run's efforts compared with all runs, minus 1; NaN in older files.
        effort_change_deviation: Its standard deviation.
    """

    name: Text
    mounting: str
    recorded: str
    residual_rms_nm: NumberList
    off: float
    friction_changes: NumberRows
    influence: NumberList
    rows: int
    struck: int
    effort_change: float = float("nan")
    effort_change_deviation: float = float("nan")


class CalibratedPayload(Table):
    """The payload of one mounting, as identified with the arm, as in the calibration's file.

    Attributes:
        mounting: Its name.
        weighed_kg: Its weighed mass; NaN if it was not weighed.
        theta: (10,) parameters in the flange frame.
        deviation: (10,) their standard deviations.
    """

    mounting: Text
    weighed_kg: float = float("nan")
    theta: NumberList
    deviation: NumberList


@dataclass(frozen=True, eq=False)
class ArmCalibration:
    """An arm of n joints as identified from its runs.

    The covariance is that of the logarithms of the gains (n), the base parameters of the links (b, in the order of
    `body.base`), rotors (n), load-dependent friction (n), Coulomb (n), viscous (n) and root friction (n), the delay
    in s and two angles of tilt in rad.

    Attributes:
        robot: Name of the robot.
        effort: Quantity to which the gains refer.
        gain_nm_a: (n,) axis torque per ampere of motor current, or per N m of reported axis torque.
        nominal: (n,) the gains assumed before; 1 if the drives report torque.
        body: Links, rotors, friction and delay.
        tilt_rad: (2,) tilt of gravity along `tilt_axes`.
        covariance: (k, k) as above.
        drift: (3, n) standard deviation of a run's Coulomb, viscous and offset changes.
        noise_nm: (n,) RMS residual, axis torque with nominal gains.
        correlation_s: (n,) correlation time of that residual: its integrated autocorrelation.
        level_nm: (n,) RMS effort, axis torque with nominal gains, for scale.
        payloads: One per mounting.
        runs: One per run that was used.
        left_out: File name and reason of every excluded run.
        warnings: Contradictions and missing information, one sentence each.
        kinematics_sha256: Hash of the chain, `kinematics_sha256`.
        provenance: What it was made from.
    """

    robot: str
    effort: Effort
    gain_nm_a: FloatArray
    nominal: FloatArray
    body: BodyModel
    tilt_rad: FloatArray
    covariance: FloatArray
    drift: FloatArray
    noise_nm: FloatArray
    correlation_s: FloatArray
    level_nm: FloatArray
    payloads: tuple[CalibratedPayload, ...]
    runs: tuple[CalibratedRun, ...]
    left_out: tuple[tuple[str, str], ...]
    warnings: tuple[str, ...]
    kinematics_sha256: str
    provenance: Provenance

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.gain_nm_a.size)

    @property
    def gain_deviation(self) -> FloatArray:
        """(n,) relative standard deviations of the gains."""
        return self.deviation(GAIN)

    @property
    def gain_half_width_95(self) -> FloatArray:
        """(n,) half widths of the gains' 95 % intervals."""
        return NORMAL_HALF_WIDTH * self.gain_deviation * self.gain_nm_a

    @property
    def determined(self) -> NDArray[np.bool_]:
        """(n,) True if the runs determine the gain; otherwise it is the assumed value, or hardly better."""
        return np.asarray(self.gain_half_width_95 <= DETERMINED_WITHIN * self.gain_nm_a)

    @property
    def scale_weighed(self) -> bool:
        """Whether a weighed payload determines the scale of all gains; otherwise the nominal gains' average does."""
        return any(np.isfinite(payload.weighed_kg) for payload in self.payloads)

    @property
    def days(self) -> tuple[str, ...]:
        """Days of the runs that state theirs, as YYYY-MM-DD, the earliest first."""
        return tuple(sorted({run.recorded[:_DAY] for run in self.runs if len(run.recorded) >= _DAY}))

    @property
    def origin(self) -> str:
        """Number, days and scale of its runs, in a few words."""
        days = self.days
        when = "" if not days else f" of {days[0]}" if len(days) == 1 else f" from {days[0]} to {days[-1]}"
        count = len(self.runs)
        scale = "scale from a weighed payload" if self.scale_weighed else "scale from the nominal gains"
        return f"{count} run{'' if count == 1 else 's'}{when}, {scale}"

    def deviation(self, name: str) -> FloatArray:
        """Standard deviations of a part of the unknowns.

        Args:
            name: One of "log_h", "links", "rotors", "load", "coulomb", "viscous", "root", "delay", "tilt".
        """
        return np.asarray(np.sqrt(np.diag(self.covariance)[self.place(name)]))

    def place(self, name: str) -> slice:
        """Indices of a part of the unknowns in the covariance; the links' are in the order of `body.base`."""
        return places_of(self.body.base)[name]

    @property
    def middle_speed_rad_s(self) -> FloatArray:
        """(n,) half of each joint's greatest speed in the runs, at which its friction is reported."""
        from armload_identification.signals.reversals import TURN_OVER

        return np.asarray(0.5 * self.body.reversal_speed_rad_s / TURN_OVER)

    @property
    def friction_nm(self) -> FloatArray:
        """(n,) friction of each joint at that speed, without load."""
        return self.body.unloaded_friction(self.middle_speed_rad_s)

    @property
    def friction_deviation_nm(self) -> FloatArray:
        """(n,) standard deviations of `friction_nm`."""
        speed, at = self.middle_speed_rad_s, slice(self.place(COULOMB).start, self.place(ROOT).stop)
        slope = np.hstack([np.eye(self.n), np.diag(speed), np.diag(np.sqrt(speed))])
        return np.asarray(np.sqrt(np.diag(slope @ self.covariance[at, at] @ slope.T)))

    def friction_change_nm(self, run: CalibratedRun) -> FloatArray:
        """(n,) difference of a run's friction at the middle speed from that of all runs, N m.

        Args:
            run: One of `runs`.
        """
        return np.asarray(run.friction_changes[0] + run.friction_changes[1] * self.middle_speed_rad_s)

    @property
    def usual_change_nm(self) -> FloatArray:
        """(n,) standard deviation of `friction_change_nm` between runs, N m."""
        return np.asarray(np.hypot(self.drift[0], self.drift[1] * self.middle_speed_rad_s))

    @property
    def friction_spread(self) -> FloatArray:
        """(3, n) standard deviation of Coulomb, viscous and offset changes on any day, cold arms included."""
        body = self.body
        steady = np.abs(body.coulomb_nm + body.root_nm * np.sqrt(self.middle_speed_rad_s))
        cold = COLD * np.stack([steady, np.abs(body.viscous_nm_s_rad), np.zeros(self.n)])
        return np.asarray(np.hypot(self.drift, cold))

    def transmission(self, nominal: Transmission) -> Transmission:
        """The arm's transmission with these gains instead of the nominal ones.

        Args:
            nominal: The configured transmission.
        """
        calibrated = replace(nominal, calibrated=self.determined, covariance=self.covariance[: self.n, : self.n])
        if self.effort is Effort.TORQUE:
            return replace(calibrated, torque_gain=self.gain_nm_a)
        return replace(calibrated, gain_nm_a=self.gain_nm_a)

    def commanded(self, coupling: FloatArray) -> FloatArray:
        """Matrix from a joint torque to the one to command to drives with nominal gains: tau C diag(k0 / k) C^-1.

        Args:
            coupling: (n, n) C of the motors.

        Returns:
            (n, n), to be multiplied from the left by a torque.
        """
        return np.asarray(coupling * (self.nominal / self.gain_nm_a) @ np.linalg.inv(coupling))

    def level(self, chain: Chain) -> Chain:
        """The chain with the identified tilt of its base.

        Args:
            chain: The configured arm.
        """
        size = float(np.sqrt(np.sum(chain.gravity_m_s2**2)))
        gravity = chain.gravity_m_s2 + size * self.tilt_rad @ tilt_axes(chain.gravity_m_s2)
        return chain.under(size * gravity / np.sqrt(np.sum(gravity**2)))

    @cached_property
    def known_arm(self) -> KnownArm:
        """The empty arm for an identification: for torque computed with these gains, on a level arm."""
        from armload_identification.estimation.empty_arm.known_arm import KnownArm
        from armload_identification.estimation.problem import EMPTY, Known

        body = self.body
        values = {
            GAIN: np.zeros(self.n),
            LINKS: body.links.ravel()[body.base.ravel()],
            ROTORS: body.rotor_inertia_kg_m2,
            LOAD_FRICTION: body.load_friction,
            COULOMB: body.coulomb_nm,
            VISCOUS: body.viscous_nm_s_rad,
            ROOT: body.root_nm,
            DELAY: np.array([body.torque_delay_s]),
            TILT: np.zeros(2),
        }
        turn = np.ones(len(self.covariance))
        turn[self.place(GAIN)] = -1.0
        size = np.sqrt(np.maximum(np.diag(self.covariance), np.finfo(float).tiny))
        power, axes = np.linalg.eigh(self.covariance / np.outer(size, size))
        whitened = (axes / np.sqrt(np.maximum(power, _LEAST_POWER * power[-1]))) * (turn / size)[:, None]
        precision = _FIRMLY**2 * whitened @ whitened.T
        mean = np.concatenate([values[name] for name in ARM_TERMS])
        return KnownArm(
            self.effort,
            body,
            self._joint_rms(self.level_nm),
            drift=self.drift,
            friction_spread=self.friction_spread,
            load_friction_spread=COLD * np.abs(body.load_friction),
            noise_nm=self._joint_rms(self.noise_nm),
            correlation_s=self.correlation_s,
            terms=tuple(known_arm_terms(values, "the calibration", np.inf)),
            known=Known(tuple((name, EMPTY) for name in ARM_TERMS), precision, precision @ mean),
            errors=self.independent_errors * turn,
        )

    @property
    def session_drift(self) -> float | None:
        """Standard deviation of the common factor of all gains between sessions; None with fewer than three sessions.

        A session is a day on which runs were recorded. The errors of its factor are part of the scatter.
        """
        days: dict[str, list[CalibratedRun]] = {}
        for run in self.runs:
            if run.recorded and np.isfinite(run.effort_change):
                days.setdefault(run.recorded[:_DAY], []).append(run)
        if len(days) < FEWEST_SESSIONS:
            return None
        factors = [
            np.average([run.effort_change for run in runs], weights=[run.effort_change_deviation**-2.0 for run in runs])
            for runs in days.values()
        ]
        return float(np.std(factors, ddof=1))

    def _joint_rms(self, axis_nm: FloatArray) -> FloatArray:
        """(n,) RMS joint torque from that of axes with nominal gains, which are taken as uncorrelated."""
        to_joint = np.linalg.inv(self.body.coupling)
        return np.asarray(np.sqrt((axis_nm * self.gain_nm_a / self.nominal) ** 2 @ to_joint**2))

    def torque_changes(
        self, chain: Chain, states: JointStates, interval_s: float, measured_nm: FloatArray
    ) -> FloatArray:
        """(p, K, n) change of a run's measured minus predicted torque per unit of each unknown of the calibration.

        `independent_errors` times this is the error of that torque: those of gains and body are correlated, as both
        were identified from the same currents.

        Args:
            chain: The arm with the tilt of its base.
            states: (K, n) each: the run's motion.
            interval_s: Time between samples.
            measured_nm: (K, n) joint torque.
        """
        body, (q, dq, ddq) = self.body, states
        base = self.body.base.ravel()
        regressor = body_regressor(chain, q, dq, ddq)
        carried = regressor @ body.links.ravel()
        direction = smooth_sign(dq, body.reversal_speed_rad_s)
        through = 1.0 + body.load_friction * direction * np.sign(carried)
        links = (regressor[:, :, base] * through[:, :, None]).transpose(2, 0, 1)
        rate = np.gradient(body.torque(chain, q, dq, ddq), interval_s, axis=0)
        friction = direction * np.abs(carried), direction, dq, direction * np.sqrt(np.abs(dq))
        still = np.zeros_like(q)
        tilt = [body_regressor(side, q, still, still) @ body.links.ravel() for side in sideways(chain)]
        changes = [
            gain_shares(measured_nm, body.coupling),
            -links,
            -rotor_columns(ddq, body.coupling).transpose(1, 0, 2),
            *(-values[None] * np.eye(self.n)[:, None, :] for values in friction),
            rate[None],
            -np.stack(tilt),
        ]
        return np.concatenate(changes)

    @cached_property
    def independent_errors(self) -> FloatArray:
        """(p, p) change of the unknowns for one standard deviation of each independent error.

        The symmetric root: any computer finds the same, as payload files that are compared refer to these errors.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)

    def require_arm(self, chain: Chain, coupling: FloatArray) -> None:
        """Raise unless the calibration belongs to an arm.

        Args:
            chain: The arm to be used with this calibration.
            coupling: (n, n) C of its motors.

        Raises:
            ModelError: different kinematics, mounting or coupling.
        """
        if chain.n != self.n or kinematics_sha256(chain) != self.kinematics_sha256:
            raise ModelError(
                "the calibration belongs to an arm with different kinematics, or to this arm mounted differently "
                "(gravity_m_s2). Give the calibration of this arm, or calibrate it with `armload calibrate`."
            )
        if not np.allclose(coupling, self.body.coupling, atol=1e-9):
            raise ModelError(
                "the calibration belongs to an arm with different motor coupling. Calibrate again with this "
                "configuration."
            )


def kinematics_sha256(chain: Chain) -> str:
    """Hash of an arm's kinematics and mounting, the same on every machine."""
    numbers = np.concatenate([part.ravel() for part in (chain.placement, chain.axis, chain.flange, chain.gravity_m_s2)])
    text = " ".join(f"{value:.{_DIGITS}f}" for value in np.round(numbers, _DIGITS) + 0.0)
    return hashlib.sha256(text.encode()).hexdigest()
