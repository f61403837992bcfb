"""Runs whose effort cannot be used together: joint torque and motor current, or either with the gains of the other.

Of a run that contains both, the torque is used.
"""

from __future__ import annotations

from typing import Final

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import reported_effort

EFFORT_NAMES: Final = {Effort.TORQUE: "joint torque", Effort.CURRENT: "motor current"}
_SELECT: Final = "`columns=` for a table, `effort=` for ROS messages"


def require_effort(run: Recording, effort: Effort) -> None:
    """Raise if the torque of a run would be computed from another quantity than the one an arm was calibrated with.

    Raises:
        RecordingError: naming the file, its content and the remedy; or it contains neither.
    """
    if effort_used(run) is not effort:
        wanted = EFFORT_NAMES[effort]
        raise RecordingError(
            f"{run.source.path}: it contains {_content(run)}, but the arm was calibrated with {wanted}, which has "
            f"other gains. Select the {wanted} ({_SELECT}), record it, or calibrate the arm from recordings like this."
        )


def require_same_effort(loaded: Recording, unloaded: Recording) -> None:
    """Raise if the torque of two runs would be computed from different quantities.

    Raises:
        RecordingError: naming both files, their content and the remedy; or one contains neither.
    """
    if effort_used(loaded) is not effort_used(unloaded):
        raise RecordingError(
            f"{loaded.source.path} contains {_content(loaded)}, and {unloaded.source.path} contains "
            f"{_content(unloaded)}: their difference would include the errors of the gains. Select the same quantity "
            f"in both ({_SELECT}), or record the same one twice."
        )


def effort_used(run: Recording) -> Effort:
    """The quantity from which a run's torque is computed.

    Raises:
        RecordingError: it contains neither.
    """
    reported_effort(run)
    return Effort.CURRENT if run.torque_nm is None else Effort.TORQUE


def _content(run: Recording) -> str:
    """What a run contains, and which of it is used."""
    if run.torque_nm is not None and run.current_a is not None:
        return f"{EFFORT_NAMES[Effort.TORQUE]} and {EFFORT_NAMES[Effort.CURRENT]}, of which the torque is used"
    return EFFORT_NAMES[effort_used(run)]
