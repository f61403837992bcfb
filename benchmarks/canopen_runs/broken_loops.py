"""Faults inside a drive's own loop, in motion: how soon they are noticed, and how far the axis goes until it stands.

The encoder of one axis counts backwards, freezes, or jumps by a turn of its motor, in the slow round and at full speed,
with all monitors of a session, over CANopen in lockstep. Each is tried where the axis is fastest, at its median speed,
and where it is slow. *Noticed* is the time until the arm's stop begins; *removal* the number of cycles from then until
"disable voltage" is on the bus; *read back* the time until the drive's statusword shows that it was obeyed; *travel*
the true travel of the axis from the fault until it stands, its commanded motion included.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import can
import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.control_errors import ControlError
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.following_monitor import FollowingMonitor
from armload_controller.cycle.plugins import CyclePlugin, CycleStep
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.checked_path import CheckedPath, check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.run_session import feedback_truth, torque_window
from armload_controller.session.session_load import SessionLoad
from armload_core import kernels
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.state_machine import POWERED, state_in
from armload_drivers.driver_errors import DriverError
from armload_drivers.servos import JointServos
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_interface import FROZEN, REVERSED, EncoderFault
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_drivers.simulation.virtual_clock import VirtualClock
from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray
from benchmarks.arms.trials import workers
from tests.fake_servos import FakeServos

ROBOTS = ("er50", "prbt")
LEGS = ("slow round", "full speed")
FAULTS = ("reversed", "frozen", "jump")
SPEEDS = {"fastest": 1.0, "median": 0.5, "slow": 0.1}
"""Where the fault occurs: the quantile of the axis's speed."""
FIRST_S = 12.0
"""The fault occurs within this time of a leg."""
SETTLED_S = 0.5
"""Before this the arm is still starting."""
AFTER_S = 1.0
"""Time for which the arm is watched after the program has ended."""
MOTOR_TURN = 1.0 / 60.0
"""A motor turn, in turns of the axis, where the file gives no gear ratio."""
NOTICED_S, TRAVEL_RAD, READ_BACK_S, REMOVAL_CYCLES = 0.040, 0.7, 0.050, 2


@dataclass(frozen=True)
class Case:
    """One fault.

    Attributes:
        robot: Name of a shipped robot.
        leg: One of `LEGS`.
        fault: One of `FAULTS`.
        joint: Index of the axis.
        speed: One of `SPEEDS`.
    """

    robot: str
    leg: str
    fault: str
    joint: int
    speed: str


@dataclass(frozen=True)
class Outcome:
    """What became of it.

    Attributes:
        speed_rad_s: Speed of the axis when the fault occurred.
        noticed_s: Time until the stop began; inf if it never did.
        removal_cycles: Cycles from then until "disable voltage" was on the bus; inf if it never was.
        read_back_s: Time from then until the statusword showed no torque; inf if it never did.
        travel_rad: Travel of the axis until it stood.
        still_moving: Whether it moved at the end.
        powered: Axes with torque at the end.
        message: Of the error.
    """

    speed_rad_s: float
    noticed_s: float
    removal_cycles: float
    read_back_s: float
    travel_rad: float
    still_moving: bool
    powered: tuple[int, ...]
    message: str


class TrackedPlant(ArmPlant):
    """A plant that records true axis positions every millisecond once a fault has occurred."""

    def __init__(self, spec: PlantSpec) -> None:
        super().__init__(spec)
        self.track: list[FloatArray] | None = None

    def advance(self, time_s: float) -> None:
        """Advance and record."""
        if self.track is None:
            super().advance(time_s)
            return
        while self.time_s < time_s - 1e-9:
            super().advance(min(time_s, self.time_s + 1e-3))
            self.track.append(self.true_rad())

    def true_rad(self) -> FloatArray:
        """(n,) true positions of the axes."""
        return np.asarray(self._to_axis @ self._position[:: self._hinges])

    @property
    def powered(self) -> tuple[int, ...]:
        """Axes with torque."""
        return tuple(np.flatnonzero(self._state[kernels.SERVO_POWER_ENDS] > self._step).tolist())


class TimedServos(CanopenServos):
    """Servos that note when a stop begins."""

    stopped_s = math.inf

    def stop(self, suspect: int | None = None) -> None:
        """Stop."""
        self.stopped_s = min(self.stopped_s, self._sync.now_s())
        super().stop(suspect)


class Targets:
    """Plug-in that records targets, and ends the motion after a while."""

    name = "targets"

    def __init__(self, cycles: int) -> None:
        self.rows: list[FloatArray] = []
        self._cycles = cycles

    def on_cycle(self, step: CycleStep) -> None:
        """Record one cycle."""
        self.rows.append(step.command.position_rad)
        if len(self.rows) > self._cycles:
            raise ControlError("enough")


class Breaker:
    """Plug-in that lets an encoder fail in a cycle."""

    name = "breaker"

    def __init__(
        self, cycle: int, plant: TrackedPlant, drives: SimulatedDrives, node_id: int, fault: EncoderFault
    ) -> None:
        self._left, self._plant, self._drives = cycle, plant, drives
        self._node_id, self._fault = node_id, fault
        self.at_s = math.nan

    def on_cycle(self, step: CycleStep) -> None:
        """Count, and break."""
        self._left -= 1
        if self._left == 0:
            self.at_s = self._plant.time_s
            self._plant.track = [self._plant.true_rad()]
            self._drives.fail_encoder(self._node_id, self._fault)


def run() -> None:
    """Print the table, and what does not meet the requirements."""
    cases = [Case(*case) for case in product(ROBOTS, LEGS, FAULTS, range(6), SPEEDS)]
    with workers() as pool:
        outcomes = measured(pool, cases)
    for robot in ROBOTS:
        rows = [(case, outcome) for case, outcome in zip(cases, outcomes, strict=True) if case.robot == robot]
        _print_table(robot, rows)


def measured(pool: Executor, cases: list[Case]) -> list[Outcome]:
    """Outcomes of all cases."""
    return list(pool.map(measure, cases))


def _print_table(robot: str, rows: list[tuple[Case, Outcome]]) -> None:
    """One arm's table."""
    print(f"{robot}: faults inside a drive's loop")
    head = f"  {'fault':9s} {'leg':11s} {'joint':>5s} {'rad/s':>6s} {'noticed':>8s}"
    print(f"{head} {'removal':>8s} {'read back':>9s} {'travel':>7s}")
    for case, outcome in rows:
        marks = [
            text
            for text, wrong in (
                ("late", outcome.noticed_s > NOTICED_S),
                ("removal", outcome.removal_cycles > REMOVAL_CYCLES or outcome.read_back_s > READ_BACK_S),
                ("far", outcome.travel_rad > TRAVEL_RAD or outcome.still_moving),
                ("POWERED", bool(outcome.powered)),
            )
            if wrong
        ]
        print(
            f"  {case.fault:9s} {case.leg:11s} {case.joint + 1:5d} {outcome.speed_rad_s:6.2f} "
            f"{outcome.noticed_s * 1e3:5.0f} ms {outcome.removal_cycles:8.0f} {outcome.read_back_s * 1e3:6.0f} ms "
            f"{outcome.travel_rad:7.3f}  {' '.join(marks)}"
        )
    worst = max(outcome.travel_rad for _, outcome in rows)
    late = sum(outcome.noticed_s > NOTICED_S for _, outcome in rows)
    print(f"  {len(rows)} faults: {late} noticed after {NOTICED_S * 1e3:.0f} ms, greatest travel {worst:.3f} rad\n")


def measure(case: Case) -> Outcome:
    """Let one fault occur."""
    robot, path = arm_and_path(case.robot)
    settings, cycle_s = robot.drives.settings, path.cycle_s
    at, speed = _moment(case)
    node_id = settings.drives[case.joint].node_id
    with ExitStack() as stack:
        plant = TrackedPlant(loaded_spec(robot, path))
        clock, wire = VirtualClock(), LockstepWire()
        bus, drives_bus, monitor = (stack.enter_context(LockstepBus(wire)) for _ in range(3))
        drives = stack.enter_context(SimulatedDrives(settings, plant, drives_bus, clock))
        servos = TimedServos(settings, bus, LockstepSync(clock))
        breaker = Breaker(at, plant, drives, node_id, encoder_fault(case.fault, robot, case.joint))
        words = _listen(monitor, clock, node_id)
        message = moved(robot, path, case.leg, servos, [breaker])
        plant.advance(plant.time_s + AFTER_S)
        powered = plant.powered
    track = np.array(plant.track)[:, case.joint]
    stop_s = servos.stopped_s
    since = [(at_s - stop_s, kind, word) for at_s, kind, word in words if at_s >= stop_s]
    asked_s = next((after_s for after_s, kind, word in since if kind == "ask" and not word & 0x2), math.inf)
    off_s = next((after_s for after_s, kind, word in since if kind == "is" and state_in(word) not in POWERED), math.inf)
    return Outcome(
        speed,
        stop_s - breaker.at_s,
        asked_s / cycle_s,
        off_s,
        float(np.abs(track - track[0]).max()),
        bool(abs(track[-1] - track[-50]) > 1e-4),
        powered,
        message,
    )


def moved(robot: Robot, path: CheckedPath, leg: str, servos: JointServos, plugins: Sequence[CyclePlugin]) -> str:
    """Run a leg with all monitors of a session; the message of the error that ended it, if any."""
    cycle_s = path.cycle_s
    monitors: list[CyclePlugin] = [
        FollowingMonitor(robot.limits.motion, robot.bus.max_missing_cycles),
        feedback_truth(robot, cycle_s),
        torque_window(robot, SessionLoad.LOADED, cycle_s),
    ]
    gate = TorqueGate(robot.limits.added_torque_max_nm, cycle_s)
    cycle = Cycle(servos, robot.limits.motion, gate, MotionControl(), [*monitors, *plugins])
    message = ""
    servos.connect()
    try:
        with cycle.powered() as arm:
            arm.follow(path.slow if leg == LEGS[0] else path.measured, lambda share: None)
    except ControlError as error:
        message = str(error)
    try:
        servos.close()
    except DriverError as error:
        message += f" On closing: {error}"
    return message


def encoder_fault(fault: str, robot: Robot, joint: int) -> EncoderFault:
    """A fault by its name."""
    gear = robot.tables.joints[joint].gear_ratio
    turn_rad = 2.0 * math.pi * (MOTOR_TURN if gear is None else 1.0 / gear)
    return {"reversed": REVERSED, "frozen": FROZEN, "jump": EncoderFault(jump_rad=turn_rad)}[fault]


@cache
def arm_and_path(name: str) -> tuple[Robot, CheckedPath]:
    """A shipped robot, and one period of its identification's excitation."""
    robot = load_robot(name)
    one = Excitation(robot.excitations["identification"].trajectory, 1)
    cycle_s = 1 / robot.bus.cycle_hz
    return robot, check_path(one, robot.motion_constraints, cycle_s, file=robot.file, key="excitation.identification")


def loaded_spec(robot: Robot, path: CheckedPath) -> PlantSpec:
    """The loaded arm at the start of a path."""
    return replace(robot.simulation.plant_spec(robot.simulation.payload_name), start_position_rad=path.start_rad)


@cache
def _axis_speeds(name: str, leg: str) -> FloatArray:
    """(N, n) speeds of the axes' targets in the first cycles of a leg."""
    robot, path = arm_and_path(name)
    targets = Targets(round(FIRST_S / path.cycle_s))
    moved(robot, path, leg, FakeServos(robot.drives.settings, ArmPlant(loaded_spec(robot, path))), [targets])
    axes = np.array(targets.rows) @ np.linalg.inv(robot.drives.coupling).T
    return np.asarray(np.abs(np.diff(axes, axis=0)) / path.cycle_s)


def _moment(case: Case) -> tuple[int, float]:
    """Cycle in which the fault of a case occurs, and the speed of the axis then."""
    _, path = arm_and_path(case.robot)
    begin = round(SETTLED_S / path.cycle_s)
    speed = _axis_speeds(case.robot, case.leg)[begin:, case.joint]
    order = np.argsort(speed)
    chosen = int(order[round(SPEEDS[case.speed] * (len(order) - 1))])
    return begin + chosen, float(speed[chosen])


def _listen(monitor: LockstepBus, clock: VirtualClock, node_id: int) -> list[tuple[float, str, int]]:
    """Time, kind and word of every controlword to a drive and every statusword from it."""
    words: list[tuple[float, str, int]] = []
    kinds = {0x200 + node_id: "ask", 0x180 + node_id: "is"}

    def listen(message: can.Message) -> None:
        kind = kinds.get(message.arbitration_id)
        if kind is not None:
            words.append((clock(), kind, int.from_bytes(message.data[:2], "little")))
        elif message.arbitration_id == od.SDO_RX_BASE + node_id and message.data[1:3] == b"\x40\x60":
            words.append((clock(), "ask", int.from_bytes(message.data[4:6], "little")))

    monitor.listen(listen)
    return words


if __name__ == "__main__":
    run()
