"""Payload of a calibrated arm while it works: the recursive estimator, and its estimate with intervals.

`update` is one call of the kernel (`armload_core/source/estimator/payload_estimator.c`), with the drives' unfiltered
feedback and its time stamps. `estimate` must not be called in the control loop, as it takes some milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from armload_core import kernels
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.empty_arm.known_arm_rows import KnownArmRows
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import DETERMINED_SHARE, InertialParameters, derived, value_scale
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.estimator_constants import FLOOR_KG, FLOOR_SHARE, ROW_S, estimator_constants
from armload_identification.signals.joint_torque import Transmission

if TYPE_CHECKING:
    from armload_identification.calibration.session_gains import SessionGains

COLOUR: Final = 2.0
"""Ratio of an estimate's variance to that for rows as independent as their weights assume."""
LOAD_LAW: Final = 0.08
"""Share of the load-dependent friction that follows no law: gears that lose a fifth of their load to friction shift a
mass by 2 to 4 % whatever the motion, which no scatter of the rows shows."""
_ROWS_PER_SENSITIVITY: Final = 4
"""The sensitivity to gains and body is computed from every fourth stored row."""
_WEIGHTLESS_KG: Final = 1e-3
"""Mass below which the centre of mass is undefined."""


@dataclass(frozen=True, eq=False)
class LivePayload:
    """Payload of an arm, as far as determined by its motion; prints as mass and centre of mass with intervals.

    Attributes:
        time_s: Time stamp of the last sample.
        theta: (10,) estimated parameters, physically possible or not.
        values: (4,) mass in kg and centre of mass in m, flange frame.
        half_width_95: (4,) half widths of their 95 % intervals.
        determined: (4,) True for half widths of at most 20 % of the mass, or of 0.1 m.
        moving_s: (n,) time during which each joint has moved fast enough to determine its load.
        friction: (3, n) changes of Coulomb friction, viscous friction and offset since the calibration.
        changes: Number of changes of the payload.
        changed_s: Time of the last change; 0 without a change.
        change_kg: Rough size of the last change, from the second before its detection; even its sign may be wrong. The
            next estimates are more accurate.
        contact: Whether, at rest, a torque exceeds what friction can hold.
        refused: Number of samples ignored: not finite, or not later than the previous one.
        covariance: (10, 10) of theta from the rows only, without the arm's errors.
        friction_covariance: (n, 2, 2) of each joint's change of Coulomb and of viscous friction, likewise.
        gains: Drift of the gains since the calibration, as far as the motion leaves it possible; None if the intervals
            do not allow for any.
        drifted_kg: Change of the mass for one standard deviation of it.
    """

    time_s: float
    theta: FloatArray
    values: FloatArray
    half_width_95: FloatArray
    determined: NDArray[np.bool_]
    moving_s: FloatArray
    friction: FloatArray
    changes: int
    changed_s: float
    change_kg: float
    contact: bool
    refused: int
    covariance: FloatArray
    friction_covariance: FloatArray
    gains: SessionGains | None = None
    drifted_kg: float = 0.0

    @property
    def mass_kg(self) -> float:
        """The mass."""
        return float(self.values[0])

    def __str__(self) -> str:
        """Mass and centre of mass with their intervals, as far as they are determined."""
        if not self.determined[0]:
            return "not determined"
        texts = [f"{self.mass_kg:z.3f} +- {self.half_width_95[0]:.3f} kg"]
        center = zip("xyz", 1e3 * self.values[1:], 1e3 * self.half_width_95[1:], self.determined[1:], strict=True)
        for axis, value, half, sure in center:
            texts.append(f"{axis} {value:z.1f} +- {half:.1f} mm" if sure else f"{axis} not determined")
        return ", ".join(texts)

    def possible_body(self) -> InertialParameters | None:
        """The possible body nearest to the estimate; takes tens of milliseconds, so not for the control loop.

        Returns:
            The body; None if the arm may be empty.

        Raises:
            EstimationError: no possible body was found.
        """
        from armload_identification.estimation.physical_consistency import nearest_possible

        if not self.mass_kg > max(float(self.half_width_95[0]), _WEIGHTLESS_KG):
            return None
        try:
            root = np.asarray(np.linalg.cholesky(np.linalg.inv(self.covariance)).T)
            return nearest_possible(InertialParameters(self.theta), root)
        except np.linalg.LinAlgError as error:
            raise EstimationError(
                f"no possible body was found near the estimate of {self.mass_kg:.3g} kg: the covariance is not "
                "positive definite. Move more joints."
            ) from error


class PayloadEstimator:
    """The recursive estimator of a calibrated arm.

    Args:
        calibration: The arm.
        chain: The configured arm.
        transmission: Nominal gains, and coupling.
        memory_s: Time after which the weight of data has decreased to 37 %.
        session: Drift of the gains since the calibration, for the intervals; its factor is not applied here.

    Attributes:
        calibration: The arm.
        update: Call it as update(time_s, position_rad, effort) for every sample; the arrays are float64, the effort is
            in A or N m as calibrated. A sample that is not finite, or not later than the previous one, is ignored.
        update_all: The same for many samples: (k,), (k, n), (k, n).

    Raises:
        ModelError: the calibration belongs to another arm.

    Examples:
        >>> import armload
        >>> robot, run = armload.load_robot("er50"), armload.read_recording("runs/today/loaded_validation.mcap")
        >>> arm = armload.read_calibration("runs/today/arm.calibration.toml")
        >>> estimator = armload.PayloadEstimator(arm, robot.chain, robot.transmission)
        >>> for sample in zip(run.time_s, run.position_rad, run.current_a):
        ...     estimator.update(*sample)
        >>> found = estimator.estimate()
        >>> bool(abs(found.mass_kg - 9.814) < found.half_width_95[0])
        True
    """

    def __init__(
        self,
        calibration: ArmCalibration,
        chain: Chain,
        transmission: Transmission,
        session: SessionGains | None = None,
        *,
        memory_s: float = 60.0,
    ) -> None:
        self.calibration, self._session = calibration, session
        with threadpool_limits(1, "blas"):  # for matrices this small several threads take 20 times as long
            constants = estimator_constants(calibration, chain, transmission, memory_s)
            self._chain = calibration.level(chain)
        self._parameter = constants.parameter
        self._kernel = kernels.PayloadEstimator(self._chain.packed, *constants)
        self._memory_s = memory_s
        self.update = self._kernel.update
        self.update_all = self._kernel.update_all

    def exchange(self, time_s: float) -> None:
        """Another payload since a time, as known from elsewhere: the next sample forgets the old one."""
        self._kernel.exchange(time_s)

    def become(self, other: PayloadEstimator) -> None:
        """Take over the state of another estimator of the same arm; takes some tens of microseconds."""
        self._kernel.become(other._kernel)

    @property
    def changes(self) -> int:
        """Number of changes of the payload; takes a microsecond or two, unlike `estimate`."""
        return int(self._read()[-1][kernels.ESTIMATOR_CHANGES])

    def _read(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Parameters, covariance, friction, moving time and status."""
        n = self._chain.n
        read = np.empty(10), np.empty((10, 10)), np.empty((3, n)), np.empty(n), np.empty(kernels.ESTIMATOR_STATUS)
        self._kernel.read_into(*read)
        return read

    def estimate(self) -> LivePayload:
        """Payload and 95 % intervals: P = 2 C + S C_arm S^T + floor^2 + law^2.

        Returns:
            The payload as determined by the motion since its last change.
        """
        theta, covariance, friction, moving_s, status = self._read()
        mass = float(theta[0])
        values, slope = np.zeros(4), np.eye(4, 10)
        if mass > _WEIGHTLESS_KG:
            values, slope = (part[:4] for part in derived(InertialParameters(theta)))
        spread, friction_covariance = COLOUR * covariance, np.empty((self._chain.n, 3, 3))
        self._kernel.friction_into(friction_covariance)
        shifts, gains = self._shifts(theta)
        variance = np.einsum("ij,jk,ik->i", slope, spread, slope) + np.sum((slope @ shifts.T) ** 2, axis=1)
        law = LOAD_LAW * float(np.mean(self.calibration.body.load_friction))
        variance[0] += FLOOR_KG**2 + (FLOOR_SHARE**2 + law**2) * mass**2
        values[0] = mass
        width = NORMAL_HALF_WIDTH * np.sqrt(variance)
        width[1:] = np.where(mass > _WEIGHTLESS_KG, width[1:], np.inf)
        determined = width <= DETERMINED_SHARE * value_scale(abs(mass))[:4]
        determined &= determined[0]
        return LivePayload(
            time_s=float(status[kernels.ESTIMATOR_TIME]),
            theta=theta,
            values=values,
            half_width_95=width,
            determined=determined,
            moving_s=moving_s,
            friction=friction,
            changes=int(status[kernels.ESTIMATOR_CHANGES]),
            changed_s=float(status[kernels.ESTIMATOR_CHANGED]),
            change_kg=float(status[kernels.ESTIMATOR_CHANGE_MASS]),
            contact=bool(status[kernels.ESTIMATOR_CONTACT]),
            refused=int(status[kernels.ESTIMATOR_REFUSED]),
            covariance=spread,
            friction_covariance=COLOUR * friction_covariance[:, :2, :2],
            gains=gains,
            drifted_kg=0.0 if gains is None or not len(shifts) else float(shifts[-1, 0]),
        )

    def _shifts(self, theta: FloatArray) -> tuple[FloatArray, SessionGains | None]:
        """Effect of errors of gains and body on the payload, and what the rows leave of a drift of all gains.

        Returns:
            (k, 10) change of theta for one standard deviation of each, the last one for that drift; and the drift.
        """
        n, session = self._chain.n, self._session
        memory = np.empty((kernels.REMEMBERED_ROWS, 1 + 4 * n))
        rows = memory[: self._kernel.rows_into(memory)][::-_ROWS_PER_SENSITIVITY][::-1]
        if len(rows) < 2:
            return np.zeros((0, 10)), session
        q, dq, ddq, tau = (np.ascontiguousarray(part) for part in np.split(rows[:, 1:], 4, axis=1))
        faded = np.exp((rows[:, :1] - rows[-1, 0]) / (2.0 * self._memory_s))
        states, noise_nm = JointStates(q, dq, ddq), self._parameter[kernels.ESTIMATOR_NOISE]
        seen = KnownArmRows.of(self._chain, self.calibration.known_arm, states, theta, noise_nm / faded)
        # The errors are independent combinations of the unknowns, whose few effects on the payload are combined.
        changes = self.calibration.torque_changes(self._chain, states, _ROWS_PER_SENSITIVITY * ROW_S, tau)
        errors, response = self.calibration.independent_errors, seen.shifts(changes, _ROWS_PER_SENSITIVITY)
        if session is None:
            return errors @ response, None
        carried = payload_regressor(self._chain, q, dq, ddq) @ theta
        # not the measured torque, whose noise is that of the residual
        predicted = self.calibration.body.torque(self._chain, q, dq, ddq, carried)
        torques = np.stack([tau - predicted, *changes])
        (found, *seeming), information = seen.beside(predicted, torques, _ROWS_PER_SENSITIVITY)
        session = session.beside(found, float(np.sqrt(COLOUR / information + np.sum((errors @ seeming) ** 2))))
        return np.vstack([errors @ response, session.deviation * response[:n].sum(axis=0)]), session
