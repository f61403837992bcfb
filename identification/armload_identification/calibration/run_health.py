"""Health of a calibrated arm in one run: gains, friction and residual, joint by joint.

With the calibrated arm and the calibration's equations, a change of every gain, three changes of friction per joint,
and the payload's ten parameters if unknown are fitted to the run. Each has two standard deviations: from the run's own
noise, and from the calibration's errors on the run's motion, which all runs with the same motion have in common.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.calibration.arm_fit import MOVING
from armload_identification.calibration.arm_model import PER_RUN, ArmModel, Unknowns
from armload_identification.calibration.arm_rows import RunSignals, arm_rows, run_signals
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.empty_arm.impacts import struck_samples
from armload_identification.estimation.empty_arm.known_arm_rows import payload_scale
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.recording.run_start import run_start_text
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.reversals import TURN_OVER
from armload_identification.signals.robust_scale import deviation_by_median
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort
from armload_identification.verdict.recording_checks.sanity import check_run

_GAIN: Final = 0.10
"""Prior standard deviation of a gain's change."""

_LOOSE: Final = 10.0
"""Prior standard deviation of a change of friction, in multiples of the usual one."""
_STEPS: Final = 6
_SETTLED: Final = 0.02
_HUBER: Final = 2.0
_OUTLYING: Final = 3.0
_LEAST_ROWS: Final = 20
"""Least number of rows in motion of a moving joint."""
_WINDOW_S: Final = 60.0
_MOST_WINDOWS: Final = 30
_LEAST_WINDOWS: Final = 3
_PAYLOAD: Final = "payload"
_TINY: Final = 1e-12


@dataclass(frozen=True, eq=False)
class FrictionOverTime:
    """Friction along a long run, w windows.

    Attributes:
        elapsed_s: (w,) middle of each window, since the start of the run.
        friction_nm: (w, n) difference from the calibrated friction; NaN if a joint hardly moves.
        noise_nm: (w, n) standard deviations.
    """

    elapsed_s: FloatArray
    friction_nm: FloatArray
    noise_nm: FloatArray


@dataclass(frozen=True, eq=False)
class RunHealth:
    """A run compared with a calibration, n joints; NaN for a joint that hardly moves.

    Attributes:
        name: Name of the run in reports.
        recorded: Date and time of its start, ISO 8601; empty if the recording does not state it.
        length_s: Its duration.
        carried: "nothing", a mounting of the calibration, or the identified mass.
        gain_change: (n,) ratio of gain to calibrated gain, minus 1.
        gain_noise: (n,) its standard deviation due to the run's noise.
        gain_doubt: (n,) its standard deviation due to the calibration's errors.
        friction_nm: (n,) difference of the friction at half the joint's greatest speed, without load.
        friction_noise_nm: (n,) its standard deviation due to the run's noise.
        friction_doubt_nm: (n,) its standard deviation due to the calibration's errors.
        residual: (n,) ratio of the residual to the calibration's.
        residual_noise: (n,) standard deviation of its logarithm.
        residual_doubt: (n,) residual due to the calibration's errors on this motion, relative to the calibration's.
        course: Friction along a long run; None for a short one.
    """

    name: str
    recorded: str
    length_s: float
    carried: str
    gain_change: FloatArray
    gain_noise: FloatArray
    gain_doubt: FloatArray
    friction_nm: FloatArray
    friction_noise_nm: FloatArray
    friction_doubt_nm: FloatArray
    residual: FloatArray
    residual_noise: FloatArray
    residual_doubt: FloatArray
    course: FrictionOverTime | None


def run_health(
    recording: Recording,
    calibration: ArmCalibration,
    chain: Chain,
    transmission: Transmission,
    *,
    name: str,
    mounting: str | None = None,
    recorded: str = "",
) -> RunHealth:
    """Compare a run with the arm's calibration.

    Args:
        recording: The run, of any motion.
        calibration: The arm.
        chain: The configured arm.
        transmission: The configured transmission; its gains are replaced by the calibration's.
        name: Name of the run in reports.
        mounting: "" for an empty arm, or a mounting of the calibration; for any other value the payload is fitted.
        recorded: Date and time of its start, ISO 8601; from the recording if not given.

    Raises:
        ModelError: the calibration belongs to another arm.
        RecordingError: a run that does not fit the arm, is too short or invalid.
        EstimationError: a run in which no joint moves.
    """
    calibration.require_arm(chain, transmission.coupling)
    check_joints(recording, chain.n)
    require_effort(recording, calibration.effort)
    check_run(recording, transmission)
    with threadpool_limits(1):
        if calibration.effort is Effort.CURRENT:
            transmission = replace(transmission, gain_nm_a=calibration.nominal)
        signals = run_signals(recording, transmission)
        fit = _RunFit(signals, calibration, chain, mounting)
        return fit.health(name, recorded or run_start_text(recording), calibration)


class _RunFit:
    """A run's own unknowns on the calibrated arm, by the Gauss-Newton method."""

    def __init__(self, signals: RunSignals, calibration: ArmCalibration, chain: Chain, mounting: str | None) -> None:
        body = calibration.body
        known = {payload.mounting: payload.theta for payload in calibration.payloads}
        self.carried = "nothing" if mounting == "" else mounting if mounting in known else None
        loaded = self.carried != "nothing"
        base = body.base.ravel()
        of = Unknowns(calibration.n, int(np.count_nonzero(base)), (_PAYLOAD,) if loaded else ())
        peak = body.reversal_speed_rad_s / TURN_OVER
        self._signals, self._chain = signals, chain
        self._model, self._mounting = ArmModel(of, body.coupling), _PAYLOAD if loaded else ""
        self.rows = arm_rows(signals, chain, body.coupling, base, peak, loaded=loaded)
        self._apart_s = float(np.median(np.diff(self.rows.time_s))) if len(self.rows.time_s) > 1 else np.inf
        self.moved = np.count_nonzero(self.rows.weight > MOVING, axis=0) >= _LEAST_ROWS
        if not self.moved.any():
            raise EstimationError(f"{signals.name}: no joint moves long enough to determine gain or friction")
        self.x = np.zeros(of.size)
        self.x[of.log_h] = np.log(calibration.nominal / calibration.gain_nm_a)
        self.x[of.links] = body.links.ravel()[base]
        self.x[of.rotors], self.x[of.load] = body.rotor_inertia_kg_m2, body.load_friction
        self.x[of.coulomb], self.x[of.viscous] = body.coulomb_nm, body.viscous_nm_s_rad
        self.x[of.root], self.x[of.delay], self.x[of.tilt] = body.root_nm, body.torque_delay_s, calibration.tilt_rad
        fitted = np.zeros(of.size, dtype=bool)
        fitted[of.log_h] = True
        if loaded and self.carried is not None:
            self.x[of.arm :] = known[self.carried]
        fitted[of.arm :] = self.carried is None
        self._place: NDArray[np.intp] = np.concatenate([np.flatnonzero(fitted), of.size + np.arange(PER_RUN * of.n)])
        payload = payload_scale(calibration.level_nm) if self.carried is None else np.zeros(0)
        self._prior = np.concatenate([np.full(of.n, _GAIN), payload, _LOOSE * calibration.drift.ravel()])
        self._noise = calibration.noise_nm
        self._independent = np.sqrt(np.minimum(self._apart_s / calibration.correlation_s, 1.0))
        self.changes = np.zeros(PER_RUN * of.n)
        self._settle()

    def _settle(self) -> None:
        """Fit, and compute the residual."""
        of, own = self._model.unknowns, np.zeros(self._place.size)
        begin = self.x.copy()
        self.weight = self.rows.weight * self._independent / self._noise
        for step in range(_STEPS):
            residual, columns = self._left()
            size = np.abs(residual * self.rows.weight) / self._spread(residual)
            huber = np.sqrt(np.minimum(1.0, _HUBER / np.maximum(size, _TINY)))
            self.struck = struck_samples(size, self.rows.time_s)
            self.weight = self.rows.weight * self._independent * huber / np.maximum(self._noise, self._spread(residual))
            self.weight[self.struck] = 0.0
            self._information, gradient = np.diag(self._prior**-2.0), -own / self._prior**2
            for axis, part in enumerate(columns):
                tall = part * self.weight[:, axis, None]
                self._information += tall.T @ tall
                gradient += tall.T @ (residual[:, axis] * self.weight[:, axis])
            moved = np.linalg.solve(self._information, gradient)
            own = own + moved
            split = self._place.size - self.changes.size
            self.x[self._place[:split]] = begin[self._place[:split]] + own[:split]
            self.changes = own[split:]
            if step and np.sqrt(moved @ self._information @ moved) < _SETTLED * np.sqrt(moved.size):
                break
        self.residual, self._columns = self._left()
        self.covariance = np.linalg.inv(self._information)
        self.left_nm = self._spread(self.residual)
        self.mass_kg = float(self.x[of.arm]) if self._mounting else 0.0

    def _left(self) -> tuple[FloatArray, list[FloatArray]]:
        """(N, n) residual, and per axis its (N, k) columns for the run's own unknowns."""
        found = self._model.differentiate(self.rows, self._mounting, self.x, self.changes)
        where = np.full(self._model.unknowns.size + self.changes.size, -1)
        where[self._place] = np.arange(self._place.size)
        columns = []
        for values, place in zip(found.columns, found.place, strict=True):
            inside = where[place] >= 0
            whole = np.zeros((len(values), self._place.size))
            whole[:, where[place[inside]]] = values[:, inside]
            columns.append(whole)
        return self.rows.effort_nm - found.predicted_nm, columns

    def _spread(self, residual: FloatArray) -> FloatArray:
        """(n,) RMS of the rows in motion with clipped outliers, computed as the calibration's noise."""
        found = self._noise.copy()
        for axis in np.flatnonzero(self.moved):
            fast = self.rows.weight[:, axis] > MOVING
            values = (residual * self.rows.weight)[fast, axis]
            bound = _OUTLYING * max(float(deviation_by_median(values)), _TINY)
            found[axis] = max(float(np.sqrt(np.mean(np.clip(values, -bound, bound) ** 2))), _TINY)
        return found

    def health(self, name: str, recorded: str, calibration: ArmCalibration) -> RunHealth:
        """The fit as `RunHealth`."""
        n, split = calibration.n, self._place.size - self.changes.size
        friction = np.zeros((n, self._place.size))
        joints = np.arange(n)
        friction[joints, split + joints] = 1.0
        friction[joints, split + n + joints] = calibration.middle_speed_rad_s
        gain = -np.eye(n, self._place.size)
        doubts, left = self._doubts(calibration)
        apart = np.maximum(np.count_nonzero(self.rows.weight > MOVING, axis=0) * self._independent**2, 1.0)
        missing = np.where(self.moved, 0.0, np.nan)

        def noise(rows: FloatArray) -> FloatArray:
            return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", rows, self.covariance, rows)) + missing)

        def doubt(rows: FloatArray) -> FloatArray:
            return np.asarray(np.sqrt(np.sum((rows @ doubts) ** 2, axis=1)) + missing)

        begin = np.log(calibration.nominal / calibration.gain_nm_a)
        change = np.exp(begin - self.x[self._model.unknowns.log_h]) - 1.0
        at_middle = self.changes[:n] + self.changes[n : 2 * n] * calibration.middle_speed_rad_s
        return RunHealth(
            name=name,
            recorded=recorded,
            length_s=float(len(self._signals.usable) * self._signals.interval_s),
            carried=f"{self.mass_kg:z.2f} kg, as found" if self.carried is None else self.carried,
            gain_change=change + missing,
            gain_noise=noise(gain),
            gain_doubt=doubt(gain),
            friction_nm=at_middle + missing,
            friction_noise_nm=noise(friction),
            friction_doubt_nm=doubt(friction),
            residual=self.left_nm / self._noise + missing,
            residual_noise=np.sqrt(0.5 / apart) + missing,
            residual_doubt=left / self._noise + missing,
            course=self._course(calibration),
        )

    def _doubts(self, calibration: ArmCalibration) -> tuple[FloatArray, FloatArray]:
        """Effects on the run of one standard deviation of each independent error of the calibration.

        Returns:
            The (p, k) changes of the run's own unknowns, and the (n,) RMS of the remaining residual.
        """
        kept = np.rint(self.rows.time_s / self._signals.interval_s).astype(np.intp)
        signals, coupling = self._signals, calibration.body.coupling
        motion = (signals.position_rad, signals.velocity_rad_s, signals.acceleration_rad_s2)
        states = JointStates(*(np.ascontiguousarray(part[kept]) for part in motion))
        scale = np.exp(self.x[self._model.unknowns.log_h])
        to_joint = np.linalg.inv(coupling)
        measured = (self.rows.effort_nm / scale) @ to_joint
        level = calibration.level(self._chain)
        joint = calibration.torque_doubts(level, states, self._apart_s, measured)
        axis_nm = (joint @ coupling) * scale
        pull = np.zeros((self._place.size, len(axis_nm)))
        for axis, columns in enumerate(self._columns):
            pull += (columns * self.weight[:, axis, None] ** 2).T @ axis_nm[:, :, axis].T
        moved = self.covariance @ pull
        left = np.zeros(calibration.n)
        for axis, columns in enumerate(self._columns):
            rest = (axis_nm[:, :, axis].T - columns @ moved) * self.rows.weight[:, axis, None]
            left[axis] = np.sqrt(np.mean(np.sum(rest**2, axis=1)))
        return moved, left

    def _course(self, calibration: ArmCalibration) -> FrictionOverTime | None:
        """Friction by windows of a long run, with the gains and the payload of the entire run."""
        elapsed = self.rows.time_s
        length_s = float(elapsed[-1] - elapsed[0])
        count = min(int(length_s / _WINDOW_S), _MOST_WINDOWS)
        if self._signals.periodic or count < _LEAST_WINDOWS:
            return None
        n, split = calibration.n, self._place.size - self.changes.size
        edges = elapsed[0] + np.linspace(0.0, length_s, count + 1)
        window = np.clip(np.searchsorted(edges, elapsed, side="right") - 1, 0, count - 1)
        friction, noise = np.full((2, count, n), np.nan)
        middle = calibration.middle_speed_rad_s
        for number in range(count):
            rows = window == number
            information, gradient = np.diag(self._prior[split:] ** -2.0), -self.changes / self._prior[split:] ** 2
            for axis, columns in enumerate(self._columns):
                tall = columns[rows, split:] * self.weight[rows, axis, None]
                information = information + tall.T @ tall
                gradient = gradient + tall.T @ (self.residual[rows, axis] * self.weight[rows, axis])
            covariance = np.linalg.inv(information)
            own = self.changes + covariance @ gradient
            fast = np.count_nonzero(self.rows.weight[rows] > MOVING, axis=0) >= _LEAST_ROWS
            variance = np.diag(covariance)
            cross = np.diag(covariance[:n, n : 2 * n])
            size = np.sqrt(variance[:n] + middle**2 * variance[n : 2 * n] + 2.0 * middle * cross)
            friction[number, fast] = (own[:n] + own[n : 2 * n] * middle)[fast]
            noise[number, fast] = size[fast]
        return FrictionOverTime(0.5 * (edges[1:] + edges[:-1]), friction, noise)
