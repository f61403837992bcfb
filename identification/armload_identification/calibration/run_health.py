"""Health of a calibrated arm in one run: gains, friction and residual, joint by joint.

The terms of an identification on the calibrated arm, with a change of every gain, three changes of friction per joint,
and the payload's ten parameters if unknown. Each has two standard deviations: from the run's own noise, and from the
calibration's errors on the run's motion, which all runs with the same motion have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from msgspec import structs
from threadpoolctl import threadpool_limits

from armload_identification.calibration.calibration_constants import Health
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.arm_rows import ArmLayout, ArmRows, motion_with_rows
from armload_identification.estimation.arm_terms import PAYLOAD, SESSION_FRICTION, payload_term, session_friction
from armload_identification.estimation.empty_arm.known_arm_rows import payload_scale
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import EMPTY, Group, Known, Noise, Problem, RunRows
from armload_identification.estimation.solve import clipped_rms, solve
from armload_identification.estimation.term_kinds import Scope, Shared, Term
from armload_identification.float_array import FloatArray
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


class Compared(NamedTuple):
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
        course: Friction along a long run; None for a short one.
    """

    name: str
    recorded: str
    length_s: float
    carried: str
    gain: Compared
    friction: Compared
    residual: Compared
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
        (run,) = usable_runs([recording], chain.n, calibration.transmission(transmission), calibration.effort)
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
        self._mounting = PAYLOAD if loaded else EMPTY
        layout = ArmLayout(calibration.level(chain), body.coupling, body.base.ravel(), peak)
        self._rows = layout.rows(motion, loaded=loaded)
        time_s = self._rows.time_s
        self._apart_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf
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
        self._friction = session_friction(Health.loose * calibration.drift.ravel(), "ten times the usual changes")
        found = self._found = self._solved([*terms, self._friction], self._rows, [arm.known])
        # (k, s) change of all unknowns for one standard deviation of each independent error of the calibration
        self._errors = found.considered(arm.errors)

    def _solved(self, terms: Sequence[Term], rows: ArmRows, known: Sequence[Known] = ()) -> Posterior:
        """Fit; the noise is at least the calibration's."""
        correlation = np.maximum(self._calibration.correlation_s / self._apart_s, 1.0)
        noise = Noise(self._noise_nm, self._noise_nm, np.full_like(self._noise_nm, np.inf), correlation)
        group = Group((RunRows(rows, self._mounting),))
        return solve(Problem(terms, [group], noise, self._calibration.body.coupling, known), rough=True)

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
            gain=self._where_moved(gain._replace(value=np.expm1(gain.value))),
            friction=self._where_moved(self._compared(SESSION_FRICTION, self._middle)),
            residual=self._where_moved(residual),
            course=self._course(),
        )

    def _where_moved(self, found: Compared) -> Compared:
        """NaN for the other joints."""
        missing = np.where(self._moved, 0.0, np.nan)
        return Compared(*(part + missing for part in found))

    def _compared(self, name: str, slope: FloatArray, mounting: str = EMPTY) -> Compared:
        """(k, m) combinations of the values of a term."""
        of_errors = self._errors[:, self._found.problem.place(name, mounting)] @ slope.T
        return Compared(*_estimated(self._found, name, slope, mounting), np.sqrt(np.sum(of_errors**2, axis=0)))

    def _left_nm(self) -> FloatArray:
        """(n,) RMS over the rows of what the calibration's errors leave in the residual."""
        changes, left = self._errors[:, self._found.problem.free], np.zeros_like(self._noise_nm)
        for rows in self._found.weighted_rows[0]:
            unweighted = self._rows.weight[:, rows.axis] / np.where(rows.weight > 0.0, rows.weight, np.inf)
            left[rows.axis] = np.mean(np.sum((rows.rows @ changes[:, rows.place].T) ** 2, axis=1) * unweighted**2)
        return np.sqrt(left)

    def _course(self) -> FrictionOverTime | None:
        """Friction by windows of a long run, with everything else as in the entire run."""
        elapsed, found = self._rows.time_s, self._found
        length_s = float(elapsed[-1] - elapsed[0])
        count = min(int(length_s / Health.window_s), Health.most_windows)
        if self._motion.periodic or count < Health.fewest_windows:
            return None
        edges = elapsed[0] + np.linspace(0.0, length_s, count + 1)
        window = np.clip(np.searchsorted(edges, elapsed, side="right") - 1, 0, count - 1)
        terms = [
            structs.replace(term, mean=found.x[place], deviation=np.zeros_like(term.mean))
            for term, place in found.groups[0].acting[0]
            if term.name != SESSION_FRICTION
        ]
        friction, noise = np.full((2, count, self._calibration.n), np.nan)
        for number in range(count):
            rows = self._rows.only(window == number)
            change, deviation = _estimated(self._solved([*terms, self._friction], rows), SESSION_FRICTION, self._middle)
            fast = np.count_nonzero(rows.weight > Solver.moving, axis=0) >= Health.fewest_rows
            friction[number, fast], noise[number, fast] = change[fast], deviation[fast]
        return FrictionOverTime(0.5 * (edges[1:] + edges[:-1]), friction, noise)


def _estimated(found: Posterior, name: str, slope: FloatArray, mounting: str = EMPTY) -> tuple[FloatArray, FloatArray]:
    """(k,) combinations of the values of a term by their (k, m) slope, and their standard deviations by the noise."""
    place = found.problem.place(name, mounting)
    return slope @ found.value(name, mounting), np.sqrt(np.diag(slope @ found.bread[place, place] @ slope.T))
