"""The commissioning: what is run and recorded, in which order, and what is made of the recordings.

    unloaded: identification, validation        payload mounted        loaded: identification, validation
    -> estimate from the identification pair -> judged on the validation pair -> payload.toml, report.html

Every path is new to every load: each of the four runs begins with a slow round, after which the drives are off and
the operator is asked. Consent may be given beforehand, but for the first motion with a payload on a real arm; the
slow round cannot be left out.

The two halves can be made in different processes: each leaves its recordings in the run's directory, and the
second takes up the first's.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Protocol

from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.control_cycle import Cycle, PoweredArm, require_going
from armload_controller.cycle.monitors import CycleSummary, FollowingMonitor, TorqueWindow
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.obstacles import Cell
from armload_controller.motion.phase import Leg
from armload_controller.motion.setpoints import check_leg, plan_approach, plan_legs
from armload_core.arrays import FloatArray
from armload_drivers.servos import JointServos
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.recording.recording import (
    CONFIGURATION_ATTACHMENT,
    EXCITATION_ATTACHMENT,
    RUN_ATTACHMENT,
    Recording,
    read_recording,
)

ROLES = ("identification", "validation")
"""Excitations of a commissioning: the first is identified from, the second judges the result."""
BAR = 1000
"""Length of a progress bar."""


class Load(StrEnum):
    """What hangs on the flange in a half of the commissioning."""

    UNLOADED = "unloaded"
    LOADED = "loaded"


class Watcher(Protocol):
    """Who watches a commissioning, such as the command line."""

    def step(self, text: str) -> None:
        """Something begins."""

    def track(self, text: str, total: int) -> AbstractContextManager[Callable[[int], None]]:
        """Something of known length begins; the function given takes how much of it is done."""


ServosFactory = Callable[[Load], AbstractContextManager[JointServos]]
"""Opens the arm as it is in one half; connecting and closing are the caller's and the manager's business."""


@dataclass(frozen=True)
class Pair:
    """The same excitation run empty and loaded."""

    unloaded: Recording
    loaded: Recording


def recording_path(directory: Path, load: Load, role: str) -> Path:
    """Where a run is recorded."""
    return directory / f"{load}_{role}.mcap"


@dataclass(frozen=True)
class Consent:
    """How the operator's consent is got.

    Attributes:
        ask: Puts a question; True is yes.
        given: The operator has agreed beforehand to what may be agreed to beforehand.
    """

    ask: Callable[[str], bool]
    given: bool

    def require(self, servos: JointServos, question: str, *, always: bool) -> None:
        """Go on only with consent; a simulated arm needs none.

        Args:
            servos: The arm, connected.
            question: What is going to happen.
            always: Ask even where consent was given beforehand.

        Raises:
            CommissioningError: the answer is no.
        """
        if servos.simulated or (self.given and not always):
            return
        if not self.ask(question):
            raise CommissioningError("not confirmed: nothing was moved. The drives are off, the brakes are on")


def record_half(
    robot: Robot,
    load: Load,
    open_servos: ServosFactory,
    directory: Path,
    watcher: Watcher,
    control: MotionControl,
    consent: Consent,
    created: str,
) -> list[CycleSummary]:
    """Run the excitations that have not been recorded with one load, and record them.

    Args:
        robot: The arm.
        load: What hangs on its flange now.
        open_servos: Opens the arm.
        directory: Where the recordings go.
        watcher: Is told what happens.
        control: The operator's hand on the motion.
        consent: The operator's agreement.
        created: Date and time of the commissioning, for the recordings.

    Raises:
        CommissioningError: the robot has no excitations, or the operator does not agree; nothing is switched on.
        ConfigurationError: an excitation touches something or asks for too much torque; nothing was switched on.
        LimitViolation: an excitation breaks a limit; nothing was switched on.
        InfeasibleMotion: there is no way onto an excitation within the limits; nothing was switched on.
        MotionError: the motion was stopped, or a stop was asked for before anything was switched on.
        DriverError: the arm could not be brought up.
    """
    cycle_s = 1 / robot.bus.cycle_hz
    roles = missing_roles(directory, load)
    excitations = [require_excitation(robot, role) for role in roles]
    for role in roles:
        robot.require_drivable(role)
    limits, cell = robot.limits.motion, robot.obstacles
    summaries = []
    runs = [plan_legs(excitation, limits, cycle_s) for excitation in excitations]
    for legs in runs:
        for leg in (legs.slow, legs.measured):
            check_leg(leg, limits, cycle_s)
    require_going(control)
    with open_servos(load) as servos:
        watcher.step(f"{load}: connecting to {servos.n} drives")
        servos.connect()
        tell_weak_points(robot, servos, watcher)
        consent.require(
            servos,
            f"First motion {load}: the arm will go to the start of the excitation and round it once, slowly. Is the "
            "cell clear and the emergency stop at hand?",
            always=load is Load.LOADED,
        )
        for role, excitation, legs in zip(roles, excitations, runs, strict=True):
            run = {
                "armload_version": version("armload"),
                "robot": robot.name,
                "load": load,
                "role": role,
                "simulated": servos.simulated,
                "cycle_hz": 1 / servos.cycle_s,
                "created": created,
            }
            attachments = {
                CONFIGURATION_ATTACHMENT: robot.text,
                EXCITATION_ATTACHMENT: format_excitation(excitation),
                RUN_ATTACHMENT: json.dumps(run),
            }
            with Recorder(recording_path(directory, load, role), attachments) as recorder:
                monitor = FollowingMonitor(limits, robot.bus.max_missing_cycles)
                cycle = Cycle(
                    servos,
                    limits,
                    TorqueGate(robot.limits.added_torque_max_nm, servos.cycle_s),
                    control,
                    [recorder, monitor, torque_window(robot, load, servos.cycle_s)],
                )
                with watcher.track(f"{load}: {role}, slow round", BAR) as progress:
                    run_leg(cycle, legs.slow, limits, cell, progress)
                consent.require(
                    servos,
                    f"{load}, {role}: the slow round is over, the drives are off. Run it at full speed?",
                    always=False,
                )
                with watcher.track(f"{load}: {role} run", BAR) as progress:
                    run_leg(cycle, legs.measured, limits, cell, progress)
                summaries.append(monitor.summary())
    return summaries


def tell_weak_points(robot: Robot, servos: JointServos, watcher: Watcher) -> None:
    """Before an arm moves that may be real: what its configuration admits to."""
    for text in () if servos.simulated else robot.drives.weak_points:
        watcher.step(f"mind: {text}")


def run_leg(cycle: Cycle, leg: Leg, limits: MotionLimits, cell: Cell, progress: Callable[[int], None]) -> None:
    """Switch the arm on, bring it to where a leg begins, run the leg, switch it off.

    Args:
        cycle: Of a connected arm that is disabled.
        leg: The leg, checked.
        limits: Of the joints.
        cell: What the way there must not touch.
        progress: Told how much of `BAR` is done.

    Raises:
        MotionError: the motion was stopped.
    """
    with cycle.powered() as arm:
        approach(arm, leg.path.evaluate(leg.start_s).position_rad, limits, cell, progress)
        arm.follow(leg, lambda share: progress(round(BAR * share)))


def approach(
    arm: PoweredArm,
    goal_rad: FloatArray,
    limits: MotionLimits,
    cell: Cell,
    progress: Callable[[int], None],
) -> None:
    """Go straight, in joint space, to where something begins.

    Args:
        arm: Standing.
        goal_rad: (n,) where to.
        limits: Of the joints.
        cell: What must not be touched on the way.
        progress: Told that nothing of what follows is done yet.

    Raises:
        BlockedWay: something would be; the arm has not moved.
        StopRequested: somebody asked for a stop.
    """
    way = plan_approach(arm.position_rad, goal_rad, limits)
    if way is None:
        return
    cell.require_free(arm.position_rad, goal_rad)
    arm.follow(way, lambda share: progress(0))


def torque_window(robot: Robot, load: Load, cycle_s: float) -> TorqueWindow:
    """The torque window of an arm: what its file tells, or its joints' greatest torque where that is not enough."""
    model = robot.strength.expected_torque(loaded=load is Load.LOADED)
    return TorqueWindow(robot.joint_names, robot.drives.transmission, robot.limits.torque_max_nm, cycle_s, model)


def missing_roles(directory: Path, load: Load) -> tuple[str, ...]:
    """Excitations that have not been recorded with a load; what was stopped on the way does not count."""
    return tuple(role for role in ROLES if not recording_path(directory, load, role).is_file())


def require_excitation(robot: Robot, role: str) -> Excitation:
    """One of the robot's excitations.

    Raises:
        CommissioningError: the configuration names none.
    """
    if role not in robot.excitations:
        raise CommissioningError(
            f"{robot.file}: no [excitation] {role}: design one with `armload design` and name it there"
        )
    return robot.excitations[role]


def read_pair(robot: Robot, directory: Path, role: str) -> Pair:
    """The empty and the loaded recording of one excitation.

    Raises:
        CommissioningError: the two do not belong together.
        RecordingError: one is missing or holds nothing usable.
    """
    pair = Pair(*(read_recording(recording_path(directory, load, role)) for load in Load))
    for recording in (pair.unloaded, pair.loaded):
        name = recording.source.run().get("robot")
        if name != robot.name:
            raise CommissioningError(f"{recording.source.path} was recorded on {name!r}, not on {robot.name!r}")
    texts = {r.source.attachments.get(EXCITATION_ATTACHMENT) for r in (pair.unloaded, pair.loaded)}
    if len(texts) != 1:
        raise CommissioningError(
            f"{directory}: the {role} runs without and with the payload followed different excitations; "
            "record both with the same configuration"
        )
    return pair


def require_recordings(directory: Path, load: Load) -> None:
    """Refuse to go on without the recordings of one half.

    Raises:
        CommissioningError: naming what is missing, and how to make it.
    """
    missing = missing_roles(directory, load)
    if missing:
        path = recording_path(directory, load, missing[0])
        raise CommissioningError(
            f"{path} is missing: make it with `armload commission ... --runs {load} --output {directory}`"
        )
