"""Recordings of an arm: read with its column map, refused where they belong to another arm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from armload_controller.config.measured_arm import MeasuredArm
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording


@dataclass(frozen=True)
class RecordingChoice:
    """What is used of a recording, and what is known of it beforehand.

    Attributes:
        columns: What stands where in a table; if not given, as the arm's file or the header says.
        effort: What the effort of a ROS message is.
        between_s: Times since the first row; everything if not given.
        episode: Number of the recording in a data set of several.
        joints: Columns of the arm's joints among those that were recorded, from 0; by name or all if not given.
    """

    columns: CsvColumns | None = None
    effort: Effort = Effort.TORQUE
    between_s: tuple[float, float] | None = None
    episode: int | None = None
    joints: tuple[int, ...] = ()


EVERYTHING = RecordingChoice()


def read_of(arm: MeasuredArm, path: Path, choice: RecordingChoice = EVERYTHING) -> Recording:
    """Read one recording.

    Args:
        arm: The arm it should belong to. Logs of other programs do not say where they come from, but may name the
            joints, and show how many there are.
        path: A recording of any format.
        choice: What is used of it.

    Raises:
        CommissioningError: it was recorded on another arm.
        RecordingError: it cannot be read, or is of an arm with other joints.
    """
    columns = choice.columns or arm.csv_columns
    recording = read_recording(
        path,
        columns,
        effort=choice.effort,
        joint_names=arm.joint_names,
        between_s=choice.between_s,
        episode=choice.episode,
    )
    return arm.own(chosen_joints(recording, choice.joints))


def chosen_joints(recording: Recording, joints: tuple[int, ...]) -> Recording:
    """Some of the joints of a recording.

    Args:
        recording: The recording.
        joints: Their columns, from 0; none for all of them.

    Raises:
        RecordingError: it does not have so many.
    """
    beyond = [joint + 1 for joint in joints if joint >= recording.n]
    if beyond:
        raise RecordingError(
            f"{recording.source.path}: no joint {beyond[0]}, the recording has {recording.n}"
            f"{': ' + ', '.join(recording.joint_names) if recording.joint_names else ''}. Correct --joints."
        )
    return recording.joints(joints) if joints else recording
