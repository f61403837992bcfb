"""Recordings of an arm: read with its column map, refused if they belong to another arm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.formats.frame_reader import DataFrame
from armload_identification.recording.reading_options import Effort, ReadingOptions
from armload_identification.recording.recording import Recording

if TYPE_CHECKING:
    from armload_controller.config.chain_from_urdf import UrdfArm
    from armload_controller.config.robot import Robot

MeasuredArm: TypeAlias = "Robot | UrdfArm"
"""What identification and validation need, without anything that moves an arm."""


@dataclass(frozen=True)
class RecordingChoice:
    """Which part of a recording is used, and how its columns are interpreted.

    Attributes:
        columns: Assignment of a table's columns; if not given, the arm's file or the header applies.
        effort: Meaning of the effort in a ROS message.
        between_s: Interval as times since the first row; everything if not given.
        episode: Number of the recording in a data set of several.
        joints: Indices, from 0, of the arm's joints among the recorded ones; by name or all if not given.
    """

    columns: CsvColumns | None = None
    effort: Effort = Effort.TORQUE
    between_s: tuple[float, float] | None = None
    episode: int | None = None
    joints: tuple[int, ...] = ()


EVERYTHING = RecordingChoice()


def read_of(arm: MeasuredArm, source: Path | DataFrame, choice: RecordingChoice = EVERYTHING) -> Recording:
    """Read one recording.

    Args:
        arm: The expected arm. Logs of other programs do not state their arm; only the number of joints, and their names
            if recorded, can be checked.
        source: A recording of any format, or a data frame.
        choice: Which part of it is used.

    Raises:
        CommissioningError: the recording is of another arm.
        RecordingError: the recording cannot be read, or has other joints.
    """
    names = () if choice.joints else arm.joint_names
    options = ReadingOptions(
        choice.columns, choice.effort, names, choice.episode, arm.position_limits_rad, arm.csv_columns
    )
    recording = read_recording_file(source, options, between_s=choice.between_s)
    return arm.own(chosen_joints(recording, choice.joints))


def chosen_joints(recording: Recording, joints: tuple[int, ...]) -> Recording:
    """Some of the joints of a recording.

    Args:
        joints: Their indices, from 0; empty for all.

    Raises:
        RecordingError: the recording has no joint of that index.
    """
    beyond = [joint + 1 for joint in joints if joint >= recording.n]
    if beyond:
        raise RecordingError(
            f"{recording.source.path}: no joint {beyond[0]}, the recording has {recording.n}"
            f"{': ' + ', '.join(recording.joint_names) if recording.joint_names else ''}. Correct `joints=`."
        )
    return recording.joints(joints) if joints else recording
