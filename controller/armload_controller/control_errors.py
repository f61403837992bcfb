"""Errors of configuration, motion and commissioning.

ControlError
 +-- ConfigurationError   a file, its key, the value found and what was expected
 +-- UnsafeBus            a bus that must not be opened like this
 +-- MotionError          the motion was stopped: cause, joint, value, bound; carries the last feedback
 +-- RecordingFailed      the disk is full, or another error of the file
 +-- CommissioningError   a step of the commissioning cannot be done as requested
 +-- OffsetRefused        a drive responds wrongly to its torque offset
 +-- ExportError          a payload that must not be exported, or a different file that exists
 +-- FleetError           recordings of many arms cannot be processed: a scheduler, a file of rows
      +-- ListingError    files that cannot be listed or read now
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from armload_identification.identification_errors import FileProblem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from armload_drivers.servos import JointFeedback


class ControlError(Exception):
    """Root of everything that `armload_controller` raises; a mistake in a recording is an `IdentificationError`.

    Examples:
        >>> import armload
        >>> try:
        ...     armload.load_robot("none.toml")
        ... except armload.ControlError as error:
        ...     print(error)
        none.toml: no such file, and no shipped robot: er50, prbt, ur10e
    """


class ConfigurationError(FileProblem, ControlError):
    """A configuration that cannot be used."""


class UnsafeBus(ControlError):
    """A bus that must not be opened like this: a real arm could be on it, or no other process can reach it."""


class RecordingFailed(ControlError):
    """The recording could not be written."""


class CommissioningError(ControlError):
    """A step of the commissioning cannot be done as requested."""


class OffsetRefused(ControlError):
    """A drive responds wrongly to its torque offset.

    Attributes:
        joints: Names of the joints.
    """

    def __init__(self, joints: tuple[str, ...], what: str) -> None:
        super().__init__(what)
        self.joints = joints


class FleetError(ControlError):
    """Recordings of many arms cannot be processed: a library, a scheduler or a file of rows."""


class ListingError(FleetError):
    """Files cannot be listed or read now: a server does not answer, or nothing installed reads such URLs."""


class ExportError(ControlError):
    """A payload that must not be exported, or a different file that exists.

    Attributes:
        file: The file that is read or written.
    """

    def __init__(self, file: str, problem: str) -> None:
        super().__init__(f"{file}: {problem}")
        self.file = file


class MotionError(ControlError):
    """The motion was stopped.

    Attributes:
        last_feedback: The last cycles before the stop, oldest first.
    """

    def __init__(self, message: str, last_feedback: Sequence[JointFeedback]) -> None:
        super().__init__(message)
        self.last_feedback = tuple(last_feedback)
