"""Health of a calibrated arm in one run: gains, friction and residual, joint by joint.

With the calibrated arm and the calibration's equations, a change of every gain, three changes of friction per joint,
and the payload's ten parameters if unknown are fitted to the run. Each has two standard deviations: from the run's own
noise, and from the calibration's errors on the run's motion, which all runs with the same motion have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.calibration.calibration_constants import Health
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.arm_rows import ArmLayout, ArmRows, RunSignals, run_signals
from armload_identification.estimation.arm_terms import (
    ARM_TERMS,
    FRICTION_CHANGE,
    GAIN,
    LAWS,
    PAYLOAD,
    known_arm_terms,
    own_friction,
    payload_term,
)
from armload_identification.estimation.empty_arm.known_arm_rows import payload_scale
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import EMPTY, Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import clipped_rms, solve
from armload_identification.estimation.term_kinds import Scope, Term
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import PARAMETERS
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_start import run_start_text
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.reversals import TURN_OVER
from armload_identification.verdict.recording_checks.usable_runs import usable_runs


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
    mounting: str | None = None,
    recorded: str = "",
) -> RunHealth:
    """Compare a run with the arm's calibration.

    Args:
        recording: The run, of any motion.
        chain: The configured arm.
        transmission: The configured transmission; its gains are replaced by the calibration's.
        mounting: "" for an empty arm, or a mounting of the calibration; for any other value the payload is fitted.
        recorded: Date and time of its start, ISO 8601; from the recording if not given.

    Raises:
        ModelError: the calibration belongs to another arm.
        RecordingError: a run that does not fit the arm, is too short, without motion or invalid.
        EstimationError: a run in which no joint moves long enough.
    """
    calibration.require_arm(chain, transmission.coupling)
    with threadpool_limits(1):
        if calibration.effort is Effort.CURRENT:
            transmission = replace(transmission, gain_nm_a=calibration.nominal)
        (run,) = usable_runs([recording], chain.n, transmission, calibration.effort)
        fit = _RunFit(run_signals(run, transmission.coupling), calibration, chain, mounting)
        return fit.health(recording.source.path.name, recorded or run_start_text(recording))


class _RunFit:
    """A run's own gains, friction and, if it is not known, payload on the calibrated arm."""

    def __init__(self, signals: RunSignals, calibration: ArmCalibration, chain: Chain, mounting: str | None) -> None:
        body = calibration.body
        known = {payload.mounting: payload.theta for payload in calibration.payloads}
        self._carried = "nothing" if mounting == "" else mounting if mounting in known else None
        loaded = self._carried != "nothing"
        peak = body.reversal_speed_rad_s / TURN_OVER
        self._signals, self._calibration, self._chain = signals, calibration, chain
        self._mounting = PAYLOAD if loaded else EMPTY
        self._rows = ArmLayout(chain, body.coupling, body.base.ravel(), peak).rows(signals, loaded=loaded)
        time_s = self._rows.time_s
        self._apart_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf
        self._moved = np.count_nonzero(self._rows.weight > Solver.moving, axis=0) >= Health.fewest_rows
        if not self._moved.any():
            raise EstimationError("no joint moves long enough to determine gain or friction")
        nominal = np.log(calibration.nominal / calibration.gain_nm_a)
        gain = Term(
            GAIN, Scope.ARM, LAWS[GAIN], nominal, np.full(calibration.n, Health.gain), "a drive that was exchanged"
        )
        payload = payload_term(np.zeros(PARAMETERS), payload_scale(calibration.level_nm), "what the arm may carry")
        if loaded and self._carried is not None:
            payload = payload_term(known[self._carried], np.zeros(PARAMETERS), "the calibration")
        self._changes = own_friction(Health.loose * calibration.drift.ravel(), "ten times the usual changes")
        arm = [gain if term.name == GAIN else term for term in calibration.arm_terms()]
        self._found = self._solved([*arm, payload, self._changes], self._rows)

    def _solved(self, terms: Sequence[Term], rows: ArmRows) -> Posterior:
        """Fit; the noise is at least the calibration's."""
        calibration = self._calibration
        correlation = np.maximum(calibration.correlation_s / self._apart_s, 1.0)
        least = calibration.noise_nm
        noise = Noise(least, least, np.full_like(least, np.inf), correlation)
        group = Group((RunRows(rows, self._mounting),))
        return solve(Problem(terms, [group], noise, calibration.body.coupling), rough=True)

    def health(self, name: str, recorded: str) -> RunHealth:
        """The fit as `RunHealth`."""
        calibration, found = self._calibration, self._found
        gains = found.problem.place(GAIN)
        friction, friction_noise = self._friction(found)
        of_arm = self._torque_doubts()
        of_gain, of_own = found.response(of_arm)
        missing = np.where(self._moved, 0.0, np.nan)
        counted = np.count_nonzero(self._rows.weight > Solver.moving, axis=0) / found.correlation[0]
        state = found.groups[0]
        carried = self._carried
        if carried is None:
            mass = found.problem.place(PAYLOAD, PAYLOAD).start
            width = NORMAL_HALF_WIDTH * np.sqrt(found.bread[mass, mass] + np.sum(of_gain[mass] ** 2))
            carried = f"{found.value(PAYLOAD, PAYLOAD)[0]:z.2f} +- {width:.2f} kg, with this calibration"
        left = self._left_by(of_arm, of_gain, of_own)
        return RunHealth(
            name=name,
            recorded=recorded,
            length_s=float(len(self._signals.usable) * self._signals.interval_s),
            carried=carried,
            gain_change=np.exp(np.log(calibration.nominal / calibration.gain_nm_a) - found.value(GAIN)) - 1.0 + missing,
            gain_noise=np.sqrt(np.diag(found.bread)[gains]) + missing,
            gain_doubt=np.sqrt(np.sum(of_gain[gains] ** 2, axis=1)) + missing,
            friction_nm=friction + missing,
            friction_noise_nm=friction_noise + missing,
            friction_doubt_nm=np.sqrt(np.sum((self._at_middle_speed @ of_own) ** 2, axis=1)) + missing,
            residual=clipped_rms(state, self._moved) / calibration.noise_nm + missing,
            residual_noise=np.sqrt(0.5 / np.maximum(counted, 1.0)) + missing,
            residual_doubt=left / calibration.noise_nm + missing,
            course=self._course(),
        )

    @property
    def _at_middle_speed(self) -> FloatArray:
        """(n, 3 n) friction at the middle speed by the run's changes of Coulomb friction, viscous friction, offset."""
        one = np.eye(self._calibration.n)
        return np.hstack([one, one * self._calibration.middle_speed_rad_s, np.zeros_like(one)])

    def _friction(self, found: Posterior) -> tuple[FloatArray, FloatArray]:
        """(n,) the change of friction at the middle speed, and its standard deviation by the run's noise."""
        slope = self._at_middle_speed
        covariance = found.joint_covariance(np.zeros((len(slope), found.problem.shared_size)), slope, 0)
        return slope @ found.own_value(FRICTION_CHANGE), np.sqrt(np.diag(covariance))

    def _torque_doubts(self) -> FloatArray:
        """(k, N, n) axis torque of one standard deviation of each independent error of the calibration."""
        kept = np.rint(self._rows.time_s / self._signals.interval_s).astype(np.intp)
        signals, calibration, coupling = self._signals, self._calibration, self._calibration.body.coupling
        states = JointStates(*(np.ascontiguousarray(part[kept]) for part in signals.states))
        scale = np.exp(self._found.value(GAIN))
        measured = (self._rows.effort_nm / scale) @ np.linalg.inv(coupling)
        joint = calibration.torque_doubts(calibration.level(self._chain), states, self._apart_s, measured)
        return np.asarray((joint @ coupling) * scale)

    def _left_by(self, axis_nm: FloatArray, of_arm: FloatArray, of_own: FloatArray) -> FloatArray:
        """(n,) RMS over the rows of what these errors leave in the residual."""
        moved = np.concatenate([of_arm, of_own])[self._found.problem.free]
        left = np.zeros(self._calibration.n)
        weight = self._found.row_weight()[0]
        for axis, weighted in enumerate(self._found.weighted_rows(0)):
            row_weight = weight[:, axis]
            known = row_weight > 0.0
            columns = weighted.rows[known] / row_weight[known, None]
            rest = axis_nm[:, known, axis].T - columns @ moved[weighted.place]
            own = (rest * self._rows.weight[known, axis, None]) ** 2
            left[axis] = np.sqrt(np.sum(own) / len(row_weight))
        return left

    def _course(self) -> FrictionOverTime | None:
        """Friction by windows of a long run, with the gains and the payload of the entire run."""
        elapsed, calibration, found = self._rows.time_s, self._calibration, self._found
        length_s = float(elapsed[-1] - elapsed[0])
        count = min(int(length_s / Health.window_s), Health.most_windows)
        if self._signals.periodic or count < Health.fewest_windows:
            return None
        edges = elapsed[0] + np.linspace(0.0, length_s, count + 1)
        window = np.clip(np.searchsorted(edges, elapsed, side="right") - 1, 0, count - 1)
        arm = {name: found.value(name) for name in ARM_TERMS}
        terms = [*known_arm_terms(arm, "the whole run"), self._changes]
        if self._mounting:
            terms.append(payload_term(found.value(PAYLOAD, PAYLOAD), np.zeros(PARAMETERS), "the whole run"))
        friction, noise = np.full((2, count, calibration.n), np.nan)
        for number in range(count):
            rows = self._rows.only(window == number)
            part = self._solved(terms, rows)
            change, deviation = self._friction(part)
            fast = np.count_nonzero(rows.weight > Solver.moving, axis=0) >= Health.fewest_rows
            friction[number, fast], noise[number, fast] = change[fast], deviation[fast]
        return FrictionOverTime(0.5 * (edges[1:] + edges[:-1]), friction, noise)
