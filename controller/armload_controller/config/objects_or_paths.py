"""Arguments that are objects, or the names and paths that they are read from.

The tables of a robot's file are imported only where a robot is read or expected: they take more than `import numpy`.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from armload_controller.config.chain_from_urdf import UrdfArm, read_urdf_arm
from armload_controller.config.robot_recordings import MeasuredArm, read_of
from armload_controller.config.urdf_tree import is_urdf
from armload_identification.argument_types import wrong_type
from armload_identification.files.payload_file import read_payload
from armload_identification.model.payload import PayloadResult
from armload_identification.recording.formats.frame_reader import DataFrame
from armload_identification.recording.recording import Recording

if TYPE_CHECKING:
    from armload_controller.config.robot import Robot
    from armload_identification.results.findings import Findings

FilePath = str | PathLike[str]
RunSource = Recording | FilePath | DataFrame
"""A recording, the path of its file, or a data frame."""
PayloadSource: TypeAlias = "PayloadResult | Findings | FilePath"
"""A payload, a result that contains it, or the path of its file."""


def several_runs(runs: Recording | FilePath | Sequence[Recording | FilePath]) -> Sequence[Recording | FilePath]:
    """Recordings, or one of them, or a table of runs, as a list.

    Raises:
        TypeError: it is something else.
    """
    listed = [runs] if isinstance(runs, Recording | str | PathLike) or not isinstance(runs, Sequence) else runs
    for run in listed:
        if not isinstance(run, Recording | str | PathLike):
            raise wrong_type("runs", run, "recordings, their paths, or the path of a table of runs")
    return listed


def arm_of(robot: MeasuredArm | FilePath) -> MeasuredArm:
    """An arm for recordings: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.

    Raises:
        ConfigurationError: the file cannot be used.
        TypeError: it is something else.
    """
    if isinstance(robot, UrdfArm):
        return robot
    if isinstance(robot, str | PathLike) and is_urdf(Path(robot)):
        return read_urdf_arm(robot)
    return robot_of(robot)


def robot_of(robot: MeasuredArm | FilePath) -> Robot:
    """A configured robot: the object, the name of a shipped robot, or the path of its TOML.

    Raises:
        ConfigurationError: the file cannot be used.
        TypeError: it is something else.
    """
    from armload_controller.config.robot import Robot, load_robot

    if isinstance(robot, str | PathLike):
        return load_robot(robot)
    if isinstance(robot, Robot):
        return robot
    raise wrong_type("robot", robot, "a Robot, the name of a shipped robot, or the path of a robot's file")


def recording_of(arm: MeasuredArm, run: RunSource, argument: str) -> Recording:
    """A recording with the arm's joints.

    Args:
        run: The recording, its path, or a data frame.
        argument: Name of the argument, for messages.

    Raises:
        RecordingError: it cannot be read, or has other joints.
        CommissioningError: it is of another arm.
        TypeError: it is something else.
    """
    if isinstance(run, Recording):
        return arm.own(run)
    if isinstance(run, str | PathLike):
        return read_of(arm, Path(run))
    if isinstance(run, DataFrame):
        return read_of(arm, run)
    expected = "a Recording (read_recording, Recording.from_arrays), the path of one, or a data frame"
    raise wrong_type(argument, run, expected)


def payload_from(payload: PayloadSource, argument: str) -> PayloadResult:
    """A payload, with its intervals.

    Args:
        payload: The payload, a result that contains it, or the path of its file.
        argument: Name of the argument, for messages.

    Raises:
        PayloadFileError: the file cannot be read.
        TypeError: it is something else.
    """
    if isinstance(payload, str | PathLike):
        return read_payload(payload)
    found = getattr(payload, "payload", payload)
    if isinstance(found, PayloadResult):
        return found
    expected = "a payload (read_payload), a result that contains it (identify), or the path of its file"
    raise wrong_type(argument, payload, expected)
