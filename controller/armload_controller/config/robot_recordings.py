"""Recordings of a configured arm: read with its column map, refused where they belong to another arm."""

from __future__ import annotations

from pathlib import Path

from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.recording import Recording, check_joints


def read_of(robot: Robot, path: Path) -> Recording:
    """Read one recording.

    Args:
        robot: The arm it should belong to. Logs of other programs do not say where they come from, but show how many
            joints the arm has.
        path: MCAP, or CSV with the columns of the robot's `[log]`.

    Raises:
        CommissioningError: it was recorded on another arm.
        RecordingError: it cannot be read, or is of an arm with another number of joints.
    """
    recording = read_recording(path, robot.csv_columns)
    name = recording.source.run().get("robot", robot.name)
    if name != robot.name:
        raise CommissioningError(
            f"{path} was recorded on {name}, not on {robot.name}: give the robot it was recorded on, or its recordings"
        )
    check_joints(recording, robot.n)
    return recording
