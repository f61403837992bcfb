"""Every row of the decision table on the simulated arm: distance from the path, and time until standstill.

The loaded arm runs its validation excitation; the cause occurs in the middle of the motion. Positions are the plant's
own, behind the drives' lag, so even an undisturbed run deviates from the path.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from armload_controller.config.robot import Robot, load_robot
from armload_controller.control_errors import MotionError, OffsetRefused, RecordingFailed
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.feedback_truth import TorqueReversed
from armload_controller.cycle.following_monitor import FollowingMonitor
from armload_controller.cycle.plugins import CyclePlugin, CycleStep
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.cycle.torque_monitor import TorqueWindow
from armload_controller.motion.checked_path import CheckedPath, check_path
from armload_controller.motion.joint_limits import BeyondLimit, MotionLimits
from armload_controller.motion.motion_control import MotionControl, OperatorStop, TerminationStop
from armload_controller.motion.paths import BlockedWay
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import feedback_truth
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.driver_errors import (
    BusError,
    CommandError,
    DriveHung,
    DriveLeftOp,
    ForeignMaster,
    FramesLost,
    LinkDown,
    ServoError,
    WorkingCounterWrong,
)
from armload_drivers.servos import JointCommand, JointFeedback
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_interface import REVERSED
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.float_array import FloatArray
from tests.fake_servos import FailureKind, FakeServos, ScriptedFailure

AT_S = 1.3
"""Phase, in s, at which the cause occurs."""
LIAR = 2
"""The joint whose drive reports false values."""
STILL_RAD_S = 2e-3
"""Slower than this a joint is at standstill."""
GRID_S = 5e-4
OVER = float("inf")


@dataclass(frozen=True)
class Stop:
    """One stop.

    Attributes:
        cause: Its cause.
        deviation_rad: Greatest distance of any joint from the path, from the cause on.
        standstill_s: Time from the cause until every joint remains at standstill.
        message: Shown to the operator.
    """

    cause: Cause
    deviation_rad: float
    standstill_s: float
    message: str


class WatchedPlant(ArmPlant):
    """A plant that records its motion."""

    def __init__(self, spec: object) -> None:
        super().__init__(spec)  # type: ignore[arg-type]
        self.time: list[float] = []
        self.position: list[FloatArray] = []
        self.speed: list[float] = []

    def advance(self, time_s: float) -> None:
        """Advance, and record the true position and speed."""
        super().advance(time_s)
        sample = self.sample(OVER)
        self.time.append(self.time_s)
        self.position.append(sample.joint_position_rad)
        self.speed.append(float(np.abs(sample.joint_velocity_rad_s).max()))


class Disturbed(FakeServos):
    """Drives whose feedback is falsified, in one cycle or from it on."""

    def __init__(self, arm: ArmSettings, plant: ArmPlant, failures: Sequence[ScriptedFailure]) -> None:
        super().__init__(arm, plant, failures)
        self.at = -1
        self.event: BaseException | Callable[[JointFeedback], JointFeedback] | None = None
        self.lasts = False
        self.count = 0
        self.acted_s: float | None = None
        self._arm_plant = plant

    def exchange(self, command: JointCommand) -> JointFeedback:
        """As the fake, except in that cycle or from it on."""
        self.count += 1
        if self.event is None or self.count < self.at or (self.count > self.at and not self.lasts):
            return super().exchange(command)
        self.acted_s = self.acted_s or self._arm_plant.time_s
        if isinstance(self.event, BaseException):
            raise self.event
        return self.event(super().exchange(command))


class Lie:
    """A false value in one drive's feedback.

    Args:
        key: Field of the feedback.
        tell: From the true value, the first value and the time since then, in s, to the false value.
    """

    def __init__(self, key: str, tell: Callable[[float, float, float], float]) -> None:
        self._key, self._tell = key, tell
        self._first: tuple[float, float] | None = None
        self._last: JointFeedback | None = None

    def __call__(self, feedback: JointFeedback) -> JointFeedback:
        """The same feedback with the false value."""
        values = getattr(feedback, self._key)
        if values is None:  # these drives report no velocity: the other joints' comes from their positions
            last, self._last = self._last or feedback, feedback
            lasted_s = max(feedback.time_s - last.time_s, GRID_S)
            values = (feedback.position_rad - last.position_rad) / lasted_s
        values = values.copy()
        if self._first is None:
            self._first = float(values[LIAR]), feedback.time_s
        first, begun_s = self._first
        values[LIAR] = self._tell(float(values[LIAR]), first, feedback.time_s - begun_s)
        return feedback._replace(**{self._key: values})


def _bits(on: int = 0, off: int = 0) -> Callable[[], Lie]:
    """A statusword with changed bits."""
    return lambda: Lie("statusword", lambda word, first, since_s: (int(word) | on) & ~off)


LIES: dict[Cause | None, Callable[[], Lie]] = {
    Cause.VELOCITY: lambda: Lie("velocity_rad_s", lambda now, first, since_s: 2.0),
    Cause.TORQUE_MISSING: lambda: Lie("current_a", lambda now, first, since_s: 0.0),
    Cause.VOLTAGE: _bits(off=0x0010),
    Cause.REMOTE: _bits(off=0x0200),
    Cause.INTERNAL_LIMIT: _bits(on=0x0800),
    Cause.DRIVE_LAG: _bits(on=0x2000),
}


class Culprit:
    """A plug-in that acts once, at a phase."""

    name = "culprit"

    def __init__(self, act: Callable[[CycleStep], object]) -> None:
        self._act = act
        self.acted_s: float | None = None

    def on_cycle(self, step: CycleStep) -> None:
        """Act, if it is time."""
        reference = step.reference
        if self.acted_s is None and reference.segment is Segment.PERIODS and reference.state.phase_s >= AT_S:
            self.acted_s = step.feedback.time_s
            self._act(step)


class Sluggish:
    """A plug-in that is slow from a phase on, and the clock that it is timed by."""

    name = "sluggish"

    def __init__(self, cycle_s: float) -> None:
        self._cycle_s = cycle_s
        self.now_s = 0.0
        self.acted_s: float | None = None

    def on_cycle(self, step: CycleStep) -> None:
        """Use nine tenths of a cycle."""
        if step.reference.segment is Segment.PERIODS and step.reference.state.phase_s >= AT_S:
            self.now_s += 0.9 * self._cycle_s
            self.acted_s = step.feedback.time_s


def run() -> None:
    """Print the table."""
    robot = load_robot("er50")
    print(f"Stops of {robot.name}, loaded, at phase {AT_S} s of its validation excitation")
    print(f"  {'cause':44s} {'category':15s} {'off the path':>12s} {'stands after':>13s}")
    path = one_period(robot)
    undisturbed = measure(robot, path, None)
    print(f"  {'(none: the drives lag)':44s} {'':15s} {undisturbed.deviation_rad * 1e3:9.2f} mrad")
    for cause in Cause:
        stop = measure(robot, path, cause)
        print(
            f"  {cause.words:44s} {cause.category.title:15s} "
            f"{stop.deviation_rad * 1e3:9.2f} mrad {stop.standstill_s:11.2f} s"
        )


def one_period(robot: Robot) -> CheckedPath:
    """One period of an arm's validation excitation."""
    one = Excitation(robot.excitations["validation"].trajectory, 1)
    cycle_s = 1 / robot.bus.cycle_hz
    return check_path(one, robot.motion_constraints, cycle_s, file=robot.file, key="excitation.validation")


def measure(robot: Robot, path: CheckedPath, cause: Cause | None) -> Stop:
    """Produce a cause, and measure the stop.

    Args:
        robot: The arm.
        path: Its path.
        cause: None for an undisturbed run.

    Raises:
        RuntimeError: the arm stopped for another cause, or did not stop.
    """
    limits, cycle_s = robot.limits.motion, path.cycle_s
    trajectory = path.excitation.trajectory
    spec = replace(robot.simulation.plant_spec(robot.simulation.payload_name), start_position_rad=path.start_rad)
    lead_in = round(-path.measured.leg.start_s / cycle_s * 2) + round(AT_S / cycle_s)
    plant = WatchedPlant(spec)
    failures = _failures(cause, lead_in)
    servos = Disturbed(robot.drives.settings, plant, failures)
    servos.at, servos.event = lead_in, _event(cause, cycle_s, plant)
    servos.lasts = cause in LIES
    if cause in LIES:
        servos.event = LIES[cause]()
    control = MotionControl()
    monitors: list[CyclePlugin] = [
        FollowingMonitor(_limits(cause, limits, trajectory), robot.bus.max_missing_cycles),
        feedback_truth(robot, cycle_s),
    ]
    if cause is Cause.TORQUE:
        window = 0.5 * robot.limits.torque_max_nm
        window[1] = 300.0
        monitors.append(TorqueWindow(robot.joint_names, robot.drives.transmission, window, cycle_s, None))
    act = _act(cause, control)
    sluggish = Sluggish(cycle_s)
    witnesses: list[Disturbed | Culprit | Sluggish] = [servos, sluggish]
    if cause is Cause.PLUGIN_TOO_SLOW:
        monitors.append(sluggish)
    elif act is not None:
        culprit = Culprit(act)
        monitors.append(culprit)
        witnesses.append(culprit)
    gate = TorqueGate(robot.limits.torque_max_nm, cycle_s)
    cycle = Cycle(servos, _limits(cause, limits, trajectory), gate, control, monitors, stopwatch=lambda: sluggish.now_s)
    servos.connect()
    message = ""
    try:
        with cycle.powered() as arm:
            arm.follow(path.measured, lambda share: None)
    except MotionError as error:
        message = str(error)
        found = cause_of(error.__cause__) if error.__cause__ is not None else None
        if found is not cause:
            raise RuntimeError(f"asked for {cause}, found {found}: {error}") from error
        acted = [witness.acted_s for witness in witnesses if witness.acted_s is not None]
        begin_s = acted[0] if acted else error.last_feedback[-1].time_s
    else:
        if cause is not None:
            raise RuntimeError(f"{cause} stopped nothing")
        begin_s = AT_S
    finally:
        servos.close()
    return _look(plant, trajectory, cause or Cause.OPERATOR, begin_s, message)


def _look(plant: WatchedPlant, trajectory: FourierTrajectory, cause: Cause, begin_s: float, message: str) -> Stop:
    """Distance from the path and time until standstill, from a time on."""
    path = trajectory.evaluate(np.arange(0.0, trajectory.period_s, GRID_S)).position_rad
    time = np.array(plant.time)
    rows = np.flatnonzero(time >= begin_s)
    distance = float(KDTree(path).query(np.array(plant.position)[rows], p=np.inf)[0].max())
    moving = rows[np.array(plant.speed)[rows] > STILL_RAD_S]
    stands_s = float(time[moving[-1]] - begin_s) if moving.size else 0.0
    return Stop(cause, distance, stands_s, message)


def _limits(cause: Cause | None, limits: MotionLimits, trajectory: FourierTrajectory) -> MotionLimits:
    """For three causes: limits that the undisturbed motion violates."""
    if cause is Cause.FOLLOWING_ERROR:
        return replace(limits, following_error_rad=np.full_like(limits.following_error_rad, 0.07))
    if cause is Cause.LIMIT:
        state = trajectory.evaluate(AT_S)
        joint = int(np.argmax(np.abs(state.velocity_rad_s)))
        low, high = limits.position_min_rad.copy(), limits.position_max_rad.copy()
        (high if state.velocity_rad_s[joint] > 0 else low)[joint] = state.position_rad[joint]
        return replace(limits, position_min_rad=low, position_max_rad=high)
    if cause is Cause.DEVIATION:
        grid_s = np.arange(0.0, trajectory.period_s, GRID_S)
        peak = np.abs(trajectory.evaluate(grid_s).velocity_rad_s).max(axis=0)
        return replace(limits, velocity_max_rad_s=0.7 * peak)
    return limits


def _failures(cause: Cause | None, cycle: int) -> tuple[ScriptedFailure, ...]:
    """Scripted failures of the fake."""
    if cause is Cause.DRIVE_FAULT:
        return (ScriptedFailure(FailureKind.FAULT, 2, cycle),)
    if cause is Cause.MISSING_FEEDBACK:
        return (ScriptedFailure(FailureKind.MISSING_FEEDBACK, 2, cycle, 20),)
    return ()


def _event(
    cause: Cause | None, cycle_s: float, plant: ArmPlant
) -> BaseException | Callable[[JointFeedback], JointFeedback] | None:
    """The servos' error, falsified feedback or broken encoder in the cycle of the cause."""

    def broken(feedback: JointFeedback) -> JointFeedback:
        plant.fail_encoder(LIAR, REVERSED)
        return feedback

    events: dict[Cause, BaseException | Callable[[JointFeedback], JointFeedback]] = {
        Cause.LOOP_LOST: broken,
        Cause.STALE: lambda feedback: feedback._replace(time_s=feedback.time_s - cycle_s),
        Cause.LATE: lambda feedback: feedback._replace(skipped_cycles=10),
        Cause.DRIVE: ServoError(3, "joint_3", "streaming", "it left its state by itself", "Look at it"),
        Cause.REFUSED: CommandError("joint_3: the drive takes no torque offset"),
        Cause.BUS: BusError("bus-off"),
        Cause.FRAMES: FramesLost("4 frames in a row did not return"),
        Cause.LINK: LinkDown("interface eth1 has no link"),
        Cause.WORKING_COUNTER: WorkingCounterWrong("the working counter is 15 instead of 18"),
        Cause.LEFT_OP: DriveLeftOp(3, "joint_3", "in the cycle", "it is in SAFEOP", "Look at it"),
        Cause.HUNG: DriveHung(3, "joint_3", "in the cycle", "its firmware hangs", "Switch it off"),
        Cause.OTHER_MASTER: ForeignMaster("an SDO client writes 6065 to node 3"),
        Cause.PROGRAM: RuntimeError("a defect"),
    }
    return None if cause is None else events.get(cause)


def _act(cause: Cause | None, control: MotionControl) -> Callable[[CycleStep], object] | None:
    """What a plug-in does at the phase of the cause."""

    def raising(error: BaseException) -> Callable[[CycleStep], object]:
        def act(step: CycleStep) -> object:
            raise error

        return act

    acts: dict[Cause, Callable[[CycleStep], object]] = {
        Cause.OPERATOR: lambda step: control.stop(OperatorStop("Ctrl-C")),
        Cause.TERMINATION: lambda step: control.stop(TerminationStop("SIGTERM")),
        Cause.OPERATOR_AGAIN: raising(KeyboardInterrupt()),
        Cause.PLUGIN_REQUEST: lambda step: step.ask_to_stop("a light barrier"),
        Cause.PLUGIN_FAILED: raising(ZeroDivisionError("division by zero")),
        Cause.RECORDING: raising(RecordingFailed("run.mcap could not be written: no space left on device")),
        Cause.OFFSET: raising(OffsetRefused(("joint_3",), "joint_3: the sign is wrong")),
        Cause.BLOCKED: raising(BlockedWay("joint_3 moved by 0.0200 rad while the arm was being enabled")),
        Cause.BEYOND_LIMIT: raising(BeyondLimit("joint_3", 3.2, 3.1)),
        Cause.TORQUE_REVERSED: raising(TorqueReversed("joint_3", "the sign of current or torque is wrong")),
    }
    return None if cause is None else acts.get(cause)


if __name__ == "__main__":
    run()
