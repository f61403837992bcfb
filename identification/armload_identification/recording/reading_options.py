"""Options of a reader for information that is not in the file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from armload_identification.recording.csv_columns import CsvColumns


class Effort(StrEnum):
    """Quantity that drives report as effort: JOINT torque in N m, or MOTOR current in A."""

    TORQUE = "torque"
    CURRENT = "current"


@dataclass(frozen=True)
class ReadingOptions:
    """Information about a recording that is not in the file.

    Attributes:
        columns: The columns of a table; None to recognise them by name.
        effort: Quantity of the effort, for formats that do not specify it.
        joint_names: Names of the arm's joints, if known; of several groups of joints the reader takes the one with
            these.
        episode: Number of the recording in a data set of several.
    """

    columns: CsvColumns | None = None
    effort: Effort = Effort.TORQUE
    joint_names: Sequence[str] = ()
    episode: int | None = None
