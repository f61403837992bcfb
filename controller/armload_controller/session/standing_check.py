"""Whether the arm stands where the last recording ended, or an encoder may have lost its reference."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from armload_controller.config.robot import Robot
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats.mcap_reader import McapReader
from armload_identification.recording.reader import ReadingAccount


def moved_since_recording(robot: Robot, folder: Path, standing_rad: FloatArray) -> str:
    """What to ask the operator about joints that stand more than a motor turn from where the last recording ended.

    An encoder that has lost its reference is usually off by whole motor turns; so is a joint that was moved by hand or
    by another program, which the operator knows. Joints without a gear ratio are not compared.

    Args:
        folder: Folder of its recordings.
        standing_rad: (n,) present joint positions.

    Returns:
        The question; empty if there is nothing to ask, or no recording of this arm.
    """
    last = _last_position(robot, folder)
    if last is None:
        return ""
    file, ended_rad = last
    axes_rad = np.linalg.solve(robot.drives.coupling, standing_rad - ended_rad)
    found = [
        f"{drive.joint} by {abs(moved):.2f} rad ({turns:.1f} motor turns)"
        for drive, moved in zip(robot.drives.settings.drives, axes_rad.tolist(), strict=True)
        if drive.gear_ratio is not None and (turns := abs(moved) * drive.gear_ratio / (2.0 * math.pi)) > 1.0
    ]
    if not found:
        return ""
    return (
        f"The arm does not stand where {file} ended: {', '.join(found)}. Has it been moved since? If not, an encoder "
        "has lost its reference: do not go on. "
    )


def _last_position(robot: Robot, folder: Path) -> tuple[str, FloatArray] | None:
    """File and last joint positions of the newest recording of the arm that has any."""
    for path in sorted(folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime, reverse=True):
        account = ReadingAccount()
        try:
            blocks = list(McapReader(path).blocks(account))
        except RecordingError:  # nothing was recorded yet
            continue
        if account.joint_names == robot.joint_names:
            return path.name, blocks[-1].position_rad[-1]
    return None
