"""Health of a calibrated arm in one run: gains, friction and residual, joint by joint.

The terms of an identification on the calibrated arm, with a change of every gain, three changes of friction per joint,
and the payload's ten parameters if unknown. Each has two standard deviations: from the run's own noise, and from the
calibration's errors on the run's motion, which all runs with the same motion have in common.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.calibration.calibration_constants import Health
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.arm_rows import ArmLayout, motion_with_rows
from armload_identification.estimation.arm_terms import PAYLOAD, SESSION_FRICTION, payload_term, session_friction
from armload_identification.estimation.empty_arm.known_arm_rows import payload_scale
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.problem import EMPTY, Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import clipped_rms, solve
from armload_identification.estimation.term_kinds import Scope, Shared, Term
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_start import run_start_text
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import TURN_OVER
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

_CHANGE: Final = "change of the gains"


@dataclass(frozen=True, eq=False)
class Compared:
    """A quantity of n joints compared with the calibration; NaN for a joint that hardly moves.

    Attributes:
        value: (n,) its difference.
        noise: (n,) standard deviation of that due to the run's noise.
        doubt: (n,) standard deviation of that due to the calibration's errors.
    """

    value: FloatArray
    noise: FloatArray
    doubt: FloatArray


@dataclass(frozen=True, eq=False)
class RunHealth:
    """A run compared with a calibration.

    Attributes:
        name: Name of the run in reports.
        recorded: Date and time of its start, ISO 8601; empty if the recording does not state it.
        length_s: Its duration.
        carried: "nothing", a mounting of the calibration, or the identified mass.
        gain: Ratio of gain to calibrated gain, minus 1.
        friction: Difference of the friction at half the joint's greatest speed, without load, N m.
        residual: Logarithm of the ratio of the residual to the calibration's.
    """

    name: str
    recorded: str
    length_s: float
    carried: str
    gain: Compared
    friction: Compared
    residual: Compared


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
        gains = calibration.transmission(transmission)
        (run,) = usable_runs([recording], chain.n, gains, calibration.effort)
        fit = _RunFit(motion_with_rows(run), calibration, chain, mounting)
        return fit.health(recording.source.path.name, recorded or run_start_text(recording))


class _RunFit:
    """A run's own gains, friction and, if it is not known, payload on the calibrated arm."""

    def __init__(self, motion: Motion, calibration: ArmCalibration, chain: Chain, mounting: str | None) -> None:
        arm, body, n = calibration.known_arm, calibration.body, calibration.n
        known = {payload.mounting: payload.theta for payload in calibration.payloads}
        self._carried = "nothing" if mounting == "" else mounting if mounting in known else None
        loaded = self._carried != "nothing"
        peak = body.reversal_speed_rad_s / TURN_OVER
        self._motion, self._calibration = motion, calibration
        layout = ArmLayout(calibration.level(chain), body.coupling, body.base.ravel(), peak)
        self._rows = layout.rows(motion, loaded=loaded)
        self._moved = np.count_nonzero(self._rows.weight > Solver.moving, axis=0) >= Health.fewest_rows
        if not self._moved.any():
            raise EstimationError("no joint moves long enough to determine gain or friction")
        self._noise_nm = calibration.noise_nm * calibration.gain_nm_a / calibration.nominal
        terms = [*arm.terms, Term(_CHANGE, Scope.ARM, Shared.GAIN, np.zeros(n), np.full(n, Health.gain), "a new drive")]
        if self._carried is None:
            scale = payload_scale(calibration.level_nm)
            terms.append(payload_term(np.zeros(PARAMETERS), scale, "what the arm may carry"))
        elif loaded:
            terms.append(payload_term(known[self._carried], np.zeros(PARAMETERS), "the calibration"))
        one = np.eye(n)
        self._middle = np.hstack([one, one * calibration.middle_speed_rad_s, np.zeros_like(one)])
        terms.append(session_friction(Health.loose * calibration.drift.ravel(), "ten times the usual changes"))
        apart_s = float(np.median(np.diff(self._rows.time_s)))
        correlation = np.maximum(calibration.correlation_s / apart_s, 1.0)
        # at least the calibration's
        noise = Noise(self._noise_nm, self._noise_nm, np.full_like(self._noise_nm, np.inf), correlation)
        group = Group((RunRows(self._rows, PAYLOAD if loaded else EMPTY),))
        self._found = solve(Problem(terms, [group], noise, body.coupling, [arm.known]), rough=True)
        # (k, s) change of all unknowns for one standard deviation of each independent error of the calibration
        self._errors = self._found.considered(arm.errors)

    def health(self, name: str, recorded: str) -> RunHealth:
        """The fit as `RunHealth`."""
        found = self._found
        gain = self._compared(_CHANGE, -np.eye(self._calibration.n))
        rows = np.count_nonzero(self._rows.weight > Solver.moving, axis=0) / found.correlation[0]
        residual = Compared(
            np.log(clipped_rms(found.groups[0], self._moved) / self._noise_nm),
            np.sqrt(0.5 / np.maximum(rows, 1.0)),
            0.5 * np.log1p((self._left_nm() / self._noise_nm) ** 2),
        )
        carried = self._carried
        if carried is None:
            mass = self._compared(PAYLOAD, np.eye(1, PARAMETERS), PAYLOAD)
            width = NORMAL_HALF_WIDTH * float(np.hypot(mass.noise, mass.doubt)[0])
            carried = f"{mass.value[0]:z.2f} +- {width:.2f} kg, with this calibration"
        return RunHealth(
            name=name,
            recorded=recorded,
            length_s=len(self._motion.time_s) * self._motion.interval_s,
            carried=carried,
            gain=self._where_moved(replace(gain, value=np.expm1(gain.value))),
            friction=self._where_moved(self._compared(SESSION_FRICTION, self._middle)),
            residual=self._where_moved(residual),
        )

    def _where_moved(self, found: Compared) -> Compared:
        """NaN for the other joints."""
        missing = np.where(self._moved, 0.0, np.nan)
        return Compared(found.value + missing, found.noise + missing, found.doubt + missing)

    def _compared(self, name: str, slope: FloatArray, mounting: str = EMPTY) -> Compared:
        """(k, m) combinations of the values of a term."""
        found, place = self._found, self._found.problem.place(name, mounting)
        return Compared(
            slope @ found.value(name, mounting),
            np.sqrt(np.diag(slope @ found.bread[place, place] @ slope.T)),
            np.sqrt(np.sum((self._errors[:, place] @ slope.T) ** 2, axis=0)),
        )

    def _left_nm(self) -> FloatArray:
        """(n,) RMS over the rows of what the calibration's errors leave in the residual."""
        found, weight = self._found, self._found.row_weights[0][0]
        unweighted = np.divide(self._rows.weight, weight, out=np.zeros_like(weight), where=weight > 0.0)
        changes = self._errors[:, found.problem.free]
        left = [np.sum((rows.rows @ changes[:, rows.place].T) ** 2, axis=1) for rows in found.weighted_rows[0]]
        return np.asarray(np.sqrt(np.mean(np.transpose(left) * unweighted**2, axis=0)))
