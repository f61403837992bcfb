"""Options of a reader for information that is not in the file."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from armload_identification.recording.csv_columns import CsvColumns


class Effort(StrEnum):
    """What drives report of their effort: JOINT torque in N m, or MOTOR current in A."""

    TORQUE = "torque"
    CURRENT = "current"


@dataclass(frozen=True)
class ReadingOptions:
    """What is known of a recording beforehand.

    Attributes:
        columns: What stands where in a table; None leaves it to the names of its columns.
        effort: What an effort is of which the format does not say it.
        joint_names: Names of the arm's joints, where they are known: of several groups of joints the reader takes
            the one with these.
        episode: Number of the recording to take from a data set of several.
    """

    columns: CsvColumns | None = None
    effort: Effort = Effort.TORQUE
    joint_names: tuple[str, ...] = ()
    episode: int | None = None
