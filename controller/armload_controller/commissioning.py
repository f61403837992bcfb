"""The commissioning: what is run and recorded, in which order, and what is made of the recordings.

    unloaded: identification, validation        payload mounted        loaded: identification, validation
    -> estimate from the identification pair -> judged on the validation pair -> payload.toml, report.html

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

from armload_controller.config import Robot
from armload_controller.cycle import Cycle, CycleSummary
from armload_controller.errors import CommissioningError
from armload_controller.limits import check_setpoints
from armload_controller.recorder import Recorder
from armload_controller.setpoints import plan_path, plan_run
from armload_drivers.servos import JointServos
from armload_identification.fourier import Excitation, format_excitation
from armload_identification.recording import (
    CONFIGURATION_ATTACHMENT,
    EXCITATION_ATTACHMENT,
    RUN_ATTACHMENT,
    Recording,
    read_recording,
)

ROLES = ("identification", "validation")
"""Excitations of a commissioning: the first is identified from, the second judges the result."""


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


def record_half(
    robot: Robot,
    load: Load,
    open_servos: ServosFactory,
    directory: Path,
    watcher: Watcher,
    stop_requested: Callable[[], bool],
    created: str,
) -> list[CycleSummary]:
    """Run both excitations with one load and record them.

    Args:
        robot: The arm.
        load: What hangs on its flange now.
        open_servos: Opens the arm.
        directory: Where the recordings go.
        watcher: Is told what happens.
        stop_requested: Asked every cycle; True brings the arm to rest.
        created: Date and time of the commissioning, for the recordings.

    Raises:
        CommissioningError: a recording exists already, or the robot has no excitations; nothing was switched on.
        LimitViolation: an excitation breaks a limit; nothing was switched on.
        InfeasibleMotion: there is no way onto an excitation within the limits; nothing was switched on.
        MotionError: the motion was stopped.
        DriverError: the arm could not be brought up.
    """
    excitations = [require_excitation(robot, role) for role in ROLES]
    limits = robot.motion_limits()
    summaries = []
    plans = [plan_path(excitation, limits, 1 / robot.bus.cycle_hz) for excitation in excitations]
    for role, plan in zip(ROLES, plans, strict=True):
        require_new(recording_path(directory, load, role))
        check_setpoints(plan.position_rad, plan.velocity_rad_s, plan.acceleration_rad_s2, limits)
    with open_servos(load) as servos:
        watcher.step(f"{load}: connecting to {servos.n} drives")
        servos.connect()
        for role, excitation, on_path in zip(ROLES, excitations, plans, strict=True):
            run = {
                "armload_version": version("armload"),
                "robot": robot.name,
                "load": load,
                "role": role,
                "cycle_hz": 1 / servos.cycle_s,
                "created": created,
            }
            attachments = {
                CONFIGURATION_ATTACHMENT: robot.text,
                EXCITATION_ATTACHMENT: format_excitation(excitation),
                RUN_ATTACHMENT: json.dumps(run),
            }
            cycle = Cycle(servos, limits, stop_requested)
            with Recorder(recording_path(directory, load, role), attachments) as recorder:
                start = servos.enable().position_rad
                plan = plan_run(start, on_path, limits, servos.cycle_s)
                with watcher.track(f"{load}: {role} run", len(plan)) as progress:
                    summaries.append(cycle.run(plan, excitation.trajectory, start, recorder, progress))
            servos.stop()
            servos.disable()
    return summaries


def require_new(path: Path) -> None:
    """Refuse to record over a recording.

    Raises:
        CommissioningError: the file exists.
    """
    if path.exists():
        raise CommissioningError(f"{path} exists: recordings are never overwritten, choose another --output")


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
        CommissioningError: naming the first that is missing, and how to make it.
    """
    for role in ROLES:
        path = recording_path(directory, load, role)
        if not path.is_file():
            raise CommissioningError(
                f"{path} is missing: make it with `armload commission ... --runs {load} --output {directory}`"
            )
