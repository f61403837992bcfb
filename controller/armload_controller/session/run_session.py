"""The one way to move an arm: a session with its servos open, in which checked paths are run.

    open, connect -> warnings -> consent -> for every path: slow round -> consent -> approach, measured leg

Rules. A path is run at full speed only after its slow round in the same session, that is, with the same load and
without reconnecting. The first motion of a session requires consent, with a payload even if consent was given
beforehand. Between two motions the drives are off. A simulated arm needs no consent, but it needs a slow round, too.
Callers never receive an enabled arm: work at standstill receives a function that can only hold it in position.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError, MotionError
from armload_controller.cycle.control_cycle import Cycle, Hold, not_switched_on, require_going, stop_message
from armload_controller.cycle.feedback_truth import FeedbackError, FeedbackTruth
from armload_controller.cycle.following_monitor import CycleSummary, FollowingMonitor
from armload_controller.cycle.plugins import CyclePlugin
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.slow_round_torque import SlowRoundRows
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.cycle.torque_monitor import TorqueError, TorqueWindow
from armload_controller.motion.checked_path import CheckedLeg, CheckedPath
from armload_controller.motion.joint_limits import BeyondLimit, LimitViolation
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.paths import BlockedWay
from armload_controller.session.installed_plugins import plugins_of
from armload_controller.session.session_load import SessionLoad
from armload_controller.session.standing_check import moved_since_recording
from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.servos import JointServos
from armload_identification.float_array import FloatArray
from armload_identification.recording.run_format import WAY_ROUND_ATTACHMENT

BAR = 1000
"""Length of a progress bar."""

T = TypeVar("T")


class Display(Protocol):
    """Shows progress, for example on the console."""

    def step(self, text: str) -> None:
        """Show that something begins."""

    def track(self, text: str, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Show an activity of known length; the returned function is called with the amount done."""


class NoDisplay:
    """A `Display` that shows nothing."""

    def step(self, text: str) -> None:
        """Show nothing."""

    @contextmanager
    def track(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show nothing."""
        yield lambda done: None


@dataclass(frozen=True)
class Consent:
    """How the operator's consent is obtained.

    Attributes:
        ask: Asks a question; True means yes.
        given: Whether the operator has agreed in advance to everything that allows it.
    """

    ask: Callable[[str], bool]
    given: bool

    def agreed(self, servos: JointServos, question: str, *, always: bool) -> bool:
        """Whether the operator agrees; with a simulated arm nobody is asked."""
        return servos.simulated or (self.given and not always) or self.ask(question)

    def require(self, servos: JointServos, question: str, *, always: bool, first: bool = False) -> None:
        """Continue only with consent; a simulated arm requires none.

        Args:
            servos: The arm, connected.
            question: Describes what is about to happen.
            always: Ask even if consent was given in advance.
            first: Whether the arm has not moved since it was connected.

        Raises:
            CommissioningError: the answer is no.
        """
        if not self.agreed(servos, question, always=always):
            moved = "nothing was moved since the arm was connected, " if first else ""
            raise CommissioningError(f"not confirmed: {moved}the drives are off")


@dataclass(frozen=True)
class Operator:
    """The person at the arm.

    Attributes:
        display: Shows progress to the operator.
        control: Receives the operator's requests: pause, speed, stop.
        consent: Obtains the operator's consent.
        watching: Plug-ins that display every motion, called last.
    """

    display: Display
    control: MotionControl
    consent: Consent
    watching: tuple[CyclePlugin, ...] = ()


def no_operator() -> Operator:
    """No operator: sufficient for a simulated arm; a real one is not moved without consent."""
    return Operator(NoDisplay(), MotionControl(), Consent(lambda question: False, given=False))


ServosFactory = Callable[[SessionLoad], AbstractContextManager[JointServos]]
"""Opens an arm with a load on its flange, not yet connected; leaving the block closes it."""


@contextmanager
def run_session(
    robot: Robot, load: SessionLoad, open_servos: ServosFactory, operator: Operator
) -> Iterator[RunSession]:
    """Open and connect an arm for any number of runs within the block.

    Args:
        load: Load on its flange during the session.
        open_servos: Opens the arm.
        operator: The person at the arm.

    Raises:
        ConfigurationError: a plug-in that the robot's file names cannot be created; the arm was not opened.
        MotionError: a stop was requested, before or while the arm was connected; nothing was switched on.
        DriverError: the arm could not be connected.
    """
    require_going(operator.control)
    with plugins_of(robot) as plugins, open_servos(load) as servos:
        for plugin in plugins:
            operator.display.step(f"plug-in {plugin.name} of {plugin.package}")
        operator.display.step(f"{load}: connecting to {servos.n} drives")
        try:
            servos.connect()
            require_going(operator.control)
            for text in () if servos.simulated else robot.drives.weak_points:
                operator.display.step(f"warning: {text}")
            for text in robot.payloads.assumed_envelopes:
                operator.display.step(text)
            _show_remarks(servos, operator.display)
            yield RunSession(robot, load, servos, operator, plugins)
        finally:
            _show_remarks(servos, operator.display)


def _show_remarks(servos: JointServos, display: Display) -> None:
    """Show what the servos have remarked since the last time."""
    for text in servos.take_remarks():
        display.step(text)


@dataclass(frozen=True)
class AddedTorque:
    """Torque that plug-ins add during a run.

    Attributes:
        begin: Called with the arm standing at the start of the measured leg, to try and fade in the torque; it can only
            hold the arm there.
        warning: Warning for the operator, added to the question; consent given in advance does not cover it.
    """

    begin: Callable[[Hold], None]
    warning: str = ""


@dataclass(frozen=True)
class Course:
    """What follows the slow round of a run.

    Attributes:
        look: Returns further warnings.
        slow_only: Whether the run ends there.
        more: Called after the periods; returns the question whether to run them again, empty to end.
    """

    look: Callable[[SlowRoundRows], list[str]] = lambda rows: []
    slow_only: bool = False
    more: Callable[[], str] = lambda: ""


WHOLE = Course()
"""The periods, once."""


class RunSession:
    """Runs on one connected arm; created by `run_session`.

    Args:
        load: Load on its flange.
        servos: Its servos, connected.
        operator: The person at the arm.
        plugins: Plug-ins that the robot's file names; called in every motion.

    Attributes:
        robot: The arm.
        load: Load on the flange.
        simulated: Whether no real arm can move.
        display: Shows progress to the operator.
    """

    def __init__(
        self, robot: Robot, load: SessionLoad, servos: JointServos, operator: Operator, plugins: Sequence[CyclePlugin]
    ) -> None:
        self.robot, self._operator, self._plugins = robot, operator, plugins
        self.load, self.simulated, self._servos = load, servos.simulated, servos
        self.display = operator.display
        self._has_moved = False
        self._slow_rounds_done: set[CheckedPath] = set()

    def run(
        self,
        path: CheckedPath,
        name: str,
        *,
        recorder: Recorder | None = None,
        plugins: Sequence[CyclePlugin] = (),
        added: AddedTorque | None = None,
        course: Course = WHOLE,
    ) -> CycleSummary:
        """Run a path at full speed, preceded by its slow round unless this session has already done that.

        Args:
            name: Name of the run.
            recorder: Records all rows, including the slow round and the row for which a monitor stops the arm.
            plugins: Further plug-ins, called after the monitors.
            added: Torque that the plug-ins add during the run; None for none.
            course: What follows the slow round.

        Returns:
            The counts of the slow round and the run.

        Raises:
            CommissioningError: the path was checked for another arm or cycle, or the operator does not agree.
            MotionError: the motion was stopped.
        """
        self._require_own(path)
        monitors = self._monitors()
        rows = SlowRoundRows(self._servos.cycle_s)
        cycle = self._cycle([*([] if recorder is None else [recorder]), *monitors, rows, *plugins])
        display, consent = self._operator.display, self._operator.consent
        warning = "" if added is None else added.warning

        def go_round(via_points_rad: FloatArray) -> None:
            points = "1 point" if len(via_points_rad) == 1 else f"{len(via_points_rad)} points"
            display.step(
                f"{name}: the straight path to its start is blocked: the arm goes round the obstacle, via {points}"
            )
            if recorder is not None:
                recorder.attach(WAY_ROUND_ATTACHMENT, json.dumps({"via_points_rad": via_points_rad.tolist()}))

        if path not in self._slow_rounds_done:
            if not self._has_moved:
                since = ""
                if recorder is not None and not self.simulated:
                    since = moved_since_recording(self.robot, recorder.partial.parent, self._servos.standing_rad())
                consent.require(
                    self._servos,
                    f"{since}First motion {self.load}: the arm will move slowly to the start of the excitation and "
                    "once along it. Is the workspace clear and the emergency stop at hand?",
                    always=self.load is SessionLoad.LOADED or bool(since),
                    first=True,
                )
                self._has_moved = True
            with display.track(f"{name}, slow round", BAR) as progress, self._explained(rows, course.look):
                run_leg(cycle, path, path.slow, progress, go_round=go_round)
            for text in self._warnings_after(rows, course.look):
                display.step(f"warning: {text}")
                warning = f"{text}. {warning}"
            self._slow_rounds_done.add(path)
        if course.slow_only:
            _show_remarks(self._servos, display)
            return monitors[0].summary
        addition = "" if added is None else " with added torque"
        consent.require(
            self._servos,
            f"{name}: the slow round is complete, the drives are off. {warning}Run it at full speed{addition}?",
            always=bool(warning),
        )
        question, times = "", 0
        while not times or (question and consent.agreed(self._servos, question, always=False)):
            with display.track(f"{name}, run", BAR) as progress:
                run_leg(cycle, path, path.again(times), progress, None if added is None else added.begin, go_round)
            times += 1
            question = course.more()
        _show_remarks(self._servos, display)
        return monitors[0].summary

    def hold(self, plugins: Sequence[CyclePlugin], work: Callable[[Hold], T], *, warning: str = "") -> T:
        """Enable the arm and hold its present position during some work.

        Args:
            plugins: Plug-ins, called after the monitors.
            work: Called with the arm enabled; it can only hold the arm.
            warning: Warning for the operator, added to the question.

        Returns:
            The result of `work`.

        Raises:
            CommissioningError: the operator does not agree.
            MotionError: the work was stopped.
        """
        question = f"The arm will hold its position with torque on. {warning}Is the workspace clear?"
        self._operator.consent.require(self._servos, question, always=True)
        with self._cycle([*self._monitors(), *plugins]).powered() as arm:
            return work(arm.hold)

    def _require_own(self, path: CheckedPath) -> None:
        """Refuse a path that was checked for another robot file or another cycle time."""
        if path.constraints.robot_sha256 != self.robot.sha256:
            raise CommissioningError(
                f"this path was not checked for {self.robot.name} as configured in {self.robot.file}: check it again"
            )
        if path.cycle_s != self._servos.cycle_s:
            checked_ms, present_ms = 1e3 * path.cycle_s, 1e3 * self._servos.cycle_s
            raise CommissioningError(
                f"this path was checked for cycles of {checked_ms:g} ms, the drives run at {present_ms:g} ms: check it "
                "again"
            )

    def _cycle(self, plugins: Sequence[CyclePlugin]) -> Cycle:
        """A cycle of this arm, with the given plug-ins and those of its file."""
        robot = self.robot
        gate = TorqueGate(robot.limits.added_torque_max_nm, self._servos.cycle_s)
        every = [*plugins, *self._plugins, *self._operator.watching]
        # In virtual time a slow plug-in delays nothing; CPU time keeps a busy computer from being blamed on it.
        stopwatch = time.thread_time if robot.bus.in_virtual_time else time.perf_counter
        return Cycle(self._servos, robot.limits.motion, gate, self._operator.control, every, stopwatch)

    def _monitors(self) -> tuple[FollowingMonitor, FeedbackTruth, TorqueWindow]:
        """Of following error, feedback and cycles; of the feedback's plausibility; of the torque for this load."""
        robot, cycle_s = self.robot, self._servos.cycle_s
        following = FollowingMonitor(robot.limits.motion, robot.bus.max_missing_cycles)
        return following, feedback_truth(robot, cycle_s), torque_window(robot, self.load, cycle_s)

    @contextmanager
    def _explained(self, rows: SlowRoundRows, look: Callable[[SlowRoundRows], list[str]]) -> Iterator[None]:
        """Add to the error of an unexpected torque what the slow round has shown so far."""
        try:
            yield
        except MotionError as error:
            if not isinstance(error.__cause__, TorqueError):
                raise
            try:
                found = self._warnings_after(rows, look)
            except MotionError as wrong:
                found = [str(wrong.__cause__)]
            if not found:
                raise
            message = f"{error} The slow round until then: {'; '.join(found)}"
            raise MotionError(message, error.last_feedback) from error.__cause__

    def _warnings_after(self, rows: SlowRoundRows, look: Callable[[SlowRoundRows], list[str]]) -> list[str]:
        """Warnings for the operator after a slow round."""
        robot = self.robot
        try:
            found = rows.fitted(robot.joint_names, robot.chain, robot.drives.transmission)
        except FeedbackError as error:
            raise MotionError(stop_message(error), ()) from error
        return [] if found is None else [*found.doubts(robot.limits.torque_max_nm), *look(rows)]


def run_leg(
    cycle: Cycle,
    path: CheckedPath,
    leg: CheckedLeg,
    progress: Callable[[int], None],
    before: Callable[[Hold], None] | None = None,
    go_round: Callable[[FloatArray], None] = lambda via_points_rad: None,
) -> None:
    """Approach a path and run one of its legs; the approach is checked before the arm is enabled.

    Args:
        cycle: Cycle of a connected, disabled arm.
        leg: Its slow or its measured leg.
        progress: Called with the part of `BAR` that is done; 0 during the approach.
        before: Called with the arm standing at the start of the leg; it can only hold the arm there.
        go_round: Called with the (V, n) via points before the arm is enabled, if the straight approach is not free.

    Raises:
        MotionError: the motion was stopped; if no approach is free, nothing was switched on.
    """
    stood_rad = cycle.standing_rad()
    try:
        approach = path.approach_from(stood_rad)
    except (BeyondLimit, BlockedWay, LimitViolation) as error:
        raise not_switched_on(error) from error
    if len(approach) > 1:
        ends = (stretch.leg.path.evaluate(stretch.leg.end_s) for stretch in approach[:-1])
        go_round(np.array([end.position_rad for end in ends]))
    with cycle.powered() as arm:
        back = path.back_to(stood_rad, arm.position_rad)
        for way in (*([] if back is None else [back]), *approach):
            arm.follow(way, lambda share: progress(0))
        if before is not None:
            before(arm.hold)
        arm.follow(leg, lambda share: progress(round(BAR * share)))


def torque_window(robot: Robot, load: SessionLoad, cycle_s: float) -> TorqueWindow:
    """The torque window of an arm: from its model, or from its joints' greatest torque if the file has no model."""
    model = robot.strength.expected_torque(loaded=load is SessionLoad.LOADED)
    return TorqueWindow(robot.joint_names, robot.drives.transmission, robot.limits.torque_max_nm, cycle_s, model)


def feedback_truth(robot: Robot, cycle_s: float) -> FeedbackTruth:
    """The plausibility check of the feedback of an arm's drives."""
    modes = [drive.mode for drive in robot.drives.settings.drives]
    reports_lag = np.array([mode is OperationMode.CYCLIC_SYNCHRONOUS_POSITION for mode in modes])
    return FeedbackTruth(robot.limits.motion, robot.drives.coupling, reports_lag, cycle_s)
