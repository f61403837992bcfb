"""Recordings of an arm: read with its column map, refused where they belong to another arm."""

from __future__ import annotations

from pathlib import Path

from armload_controller.config.measured_arm import MeasuredArm
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.recording import Recording


def read_of(arm: MeasuredArm, path: Path) -> Recording:
    """Read one recording.

    Args:
        arm: The arm it should belong to. Logs of other programs do not say where they come from, but may name the
            joints, and show how many there are.
        path: MCAP, or CSV with the columns of the arm.

    Raises:
        CommissioningError: it was recorded on another arm.
        RecordingError: it cannot be read, or is of an arm with other joints.
    """
    return arm.own(read_recording(path, arm.csv_columns, joint_names=arm.joint_names))
