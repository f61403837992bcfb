"""One trajectory without and with feed-forward: the effect on the following error e = target - measured.

Nearly all of e is the servo's lag, which no torque changes: at speed dq the arm is behind by 40 ms times dq. So two
other quantities are compared:

    error due to the payload    e_loaded - e_unloaded, at the same phase: for a payload's torque
    error beyond the lag        e - (a_1 dq + a_2 d2q + a_3 d3q + a_4 d4q), fitted per run and joint: for the arm's

The first requires a run of the empty arm on the same trajectory, as in a simulation. The second requires only the run
itself: the remainder is due to torque, the payload's and the arm's own (above all friction at reversals).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import reduce

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.control_cycle import Hold
from armload_controller.cycle.plugins import CycleStep
from armload_controller.feedforward.body_torque import ArmTerm
from armload_controller.feedforward.feedforward_plugin import CheckedFeedforward, FeedforwardPlugin
from armload_controller.feedforward.offset_check import OffsetCheck, OffsetVerdict, positions_along
from armload_controller.motion.checked_path import CheckedPath
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import AddedTorque, RunSession
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import PayloadResult
from armload_identification.model.regressor import payload_torque

LOADED_SHARE = 0.2
"""A joint is gravity-loaded if the payload's gravity torque is at least this share of that on the most loaded joint."""


_STEP_S = 1e-3
"""Step in phase for the fourth derivative by a central difference, in s."""


class Measure(StrEnum):
    """The part of the following error that is compared."""

    ADDED = "following error due to the payload"
    TORQUES = "following error beyond the servo's lag"


@dataclass(frozen=True, eq=False)
class FollowingRun:
    """Following error of one run during its measured periods.

    Attributes:
        phase_s: (N,) phase along the path.
        error_rad: (N, n) target minus measured position.
    """

    phase_s: FloatArray
    error_rad: FloatArray


@dataclass(frozen=True, eq=False)
class FollowingComparison:
    """The following error without and with feed-forward.

    Attributes:
        measure: The part of the following error that is compared.
        phase_s: (N,) phase along the path.
        without_rad: (N, n) error without feed-forward.
        with_rad: (N, n) error with feed-forward by label, of one or more kinds.
        weight_nm: (n,) greatest gravity torque of the payload along the path.
    """

    measure: Measure
    joint_names: tuple[str, ...]
    phase_s: FloatArray
    without_rad: FloatArray
    with_rad: dict[str, FloatArray]
    weight_nm: FloatArray

    @property
    def gravity_loaded(self) -> tuple[int, ...]:
        """Indices, from 0, of the joints that carry the payload's weight."""
        return tuple(int(i) for i in np.flatnonzero(self.weight_nm >= LOADED_SHARE * self.weight_nm.max()))

    @property
    def without_rms_rad(self) -> FloatArray:
        """(n,) RMS over time without feed-forward."""
        return rms(self.without_rad)

    def reduction(self, label: str) -> FloatArray:
        """(n,) relative reduction of the RMS by feed-forward; NaN if there is no error without."""
        before = self.without_rms_rad
        after = rms(self.with_rad[label])
        return np.asarray(1.0 - np.divide(after, before, out=np.full_like(before, np.nan), where=before > 0.0))

    def less(self, label: str, joint: int, digits: int) -> str:
        """The reduction of one joint's error, in words."""
        share = self.reduction(label)[joint]
        if np.isnan(share):
            return "no error without it"
        return f"{100.0 * abs(share):.{digits}f} % {'less' if share >= 0.0 else 'more'}"


def beyond_lag(error_rad: FloatArray, path: FourierTrajectory, phase_s: FloatArray) -> FloatArray:
    """(N, n) following errors, at nominal speed and (N,) phases, without what is linear in the motion's derivatives."""
    state = path.evaluate(phase_s)
    jerk = [path.evaluate(phase_s + side * _STEP_S).jerk_rad_s3 for side in (1.0, -1.0)]
    fourth = (jerk[0] - jerk[1]) / (2.0 * _STEP_S)
    remaining = np.empty_like(error_rad)
    for joint in range(error_rad.shape[1]):
        derivatives = (state.velocity_rad_s, state.acceleration_rad_s2, state.jerk_rad_s3, fourth)
        columns = np.column_stack([derivative[:, joint] for derivative in derivatives])
        scale = np.abs(columns).max(axis=0)
        columns /= np.where(scale > 0.0, scale, 1.0)
        error = error_rad[:, joint]
        remaining[:, joint] = error - columns @ np.linalg.lstsq(columns, error, rcond=None)[0]
    return remaining


def rms(error_rad: FloatArray) -> FloatArray:
    """(n,) root mean square over time of (N, n)."""
    return np.asarray(np.sqrt(np.mean(error_rad**2, axis=0)))


class FollowingRecorder:
    """Plug-in that collects the following error of the measured periods."""

    name = "following error"

    def __init__(self) -> None:
        self._phase: list[float] = []
        self._error: list[FloatArray] = []

    def on_cycle(self, step: CycleStep) -> None:
        """Collect one cycle."""
        reference = step.sent_reference
        if step.sent is not None and reference is not None and reference.segment is Segment.PERIODS:
            self._phase.append(reference.state.phase_s)
            self._error.append(step.sent.position_rad - step.feedback.position_rad)

    def run(self) -> FollowingRun:
        """The collected run.

        Raises:
            CommissioningError: no cycle ran at full speed.
        """
        if not self._phase:
            raise CommissioningError(
                "no cycle at full speed: nothing to compare. Run without pausing or reducing the speed"
            )
        return FollowingRun(np.array(self._phase), np.array(self._error))


class ComparisonRuns:
    """The runs of a comparison on one arm.

    Args:
        path: The path of all runs.
        tried_nm: (n,) least torque to try at standstill on every joint; zeros if not given.
        commanded: (n, n) matrix that the row of torques is multiplied with to compensate for gain errors of the
            drives; identity if not given.
    """

    def __init__(
        self, robot: Robot, path: CheckedPath, tried_nm: FloatArray | None = None, commanded: FloatArray | None = None
    ) -> None:
        self._robot, self._path = robot, path
        self._commanded = np.eye(robot.n) if commanded is None else commanded
        self._tried_nm = np.zeros(robot.n) if tried_nm is None else tried_nm

    def plain(self, session: RunSession, text: str) -> FollowingRun:
        """A run without feed-forward.

        Args:
            session: Session with the arm.
            text: Name of the run.

        Raises:
            CommissioningError: the operator does not agree.
            MotionError: the motion was stopped.
        """
        kept = FollowingRecorder()
        session.run(self._path, text, plugins=[kept])
        return kept.run()

    def with_feedforward(
        self,
        session: RunSession,
        payload: PayloadResult,
        text: str,
        tried: OffsetVerdict | None,
        beside: ArmTerm | None = None,
    ) -> tuple[FollowingRun, OffsetVerdict]:
        """A run with feed-forward; the torque offset is tried at its start, unless it was tried before.

        Args:
            session: Session with the arm.
            payload: The payload to feed forward.
            text: Name of the run.
            tried: Result of an earlier trial in this session; None to try now.
            beside: The arm's own torque to add in this run; None for none.

        Returns:
            The run, and the result of the trial.

        Raises:
            PayloadRefused: the payload must not be fed forward; nothing has moved.
            CommissioningError: the operator does not agree.
            MotionError: the motion was stopped, for example because of a wrong torque offset.
        """
        added = self._feedforward(payload, beside)
        kept = FollowingRecorder()
        verdicts = [] if tried is None else [tried]

        def before(hold: Hold) -> None:
            if tried is None:
                verdicts.append(added.try_offset(hold))
            added.fade_in(hold, verdicts[0])

        session.run(self._path, text, plugins=[kept, added], added=AddedTorque(before))
        return kept.run(), verdicts[0]

    def try_offset(self, session: RunSession, payload: PayloadResult) -> OffsetVerdict:
        """Try the torque offset at the present position, which the arm holds; the payload's torque is not added.

        Raises:
            PayloadRefused: the payload must not be fed forward.
            CommissioningError: the operator does not agree.
            MotionError: the torque offset is wrong, or the check was stopped.
        """
        added = self._feedforward(payload, None)
        greatest = int(added.check.tried_nm.argmax())
        return session.hold(
            [added],
            added.try_offset,
            warning=f"Up to {added.check.tried_nm[greatest]:.1f} N m will be added on "
            f"{self._robot.joint_names[greatest]}, less on the others, and removed again. ",
        )

    def compare(
        self,
        without: FollowingRun,
        with_feedforward: dict[str, FollowingRun],
        empty: FollowingRun | None,
        payload: PayloadResult,
    ) -> FollowingComparison:
        """Compare runs at the phases that all of them contain.

        Args:
            without: Run of the loaded arm without feed-forward.
            with_feedforward: Runs with feed-forward, by label.
            empty: Run of the empty arm without feed-forward, for `Measure.ADDED`; None for `Measure.TORQUES`.
            payload: The payload that was fed forward.
        """
        runs = [without, *with_feedforward.values(), *([] if empty is None else [empty])]
        keys = [np.round(run.phase_s * self._robot.bus.cycle_hz).astype(np.int64) for run in runs]
        common = reduce(np.intersect1d, keys)
        rows = [run.error_rad[np.searchsorted(key, common)] for run, key in zip(runs, keys, strict=True)]
        phase_s = common / self._robot.bus.cycle_hz
        trajectory = self._path.excitation.trajectory
        rows = [beyond_lag(row, trajectory, phase_s) if empty is None else row - rows[-1] for row in rows]
        path_rad = positions_along(self._path)
        still = np.zeros_like(path_rad)
        weight = payload_torque(self._robot.chain, payload.model.theta, path_rad, still, still)
        return FollowingComparison(
            measure=Measure.TORQUES if empty is None else Measure.ADDED,
            joint_names=self._robot.joint_names,
            phase_s=phase_s,
            without_rad=rows[0],
            with_rad=dict(zip(with_feedforward, rows[1:], strict=False)),
            weight_nm=np.abs(weight).max(axis=0),
        )

    def _feedforward(self, payload: PayloadResult, beside: ArmTerm | None) -> CheckedFeedforward:
        """The feed-forward of a payload for this path, with the preceding check."""
        robot, path = self._robot, self._path
        added = FeedforwardPlugin(robot.chain, robot.name, payload, path.cycle_s, beside, self._commanded)
        return CheckedFeedforward(added, OffsetCheck.along(path, robot, payload.model, self._tried_nm))
