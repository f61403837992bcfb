"""Options of a reader for information that is not in the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from armload_identification.identification_errors import NamelessColumns, RecordingError

if TYPE_CHECKING:  # the command line's options need no numpy
    from armload_identification.float_array import FloatArray
    from armload_identification.recording.csv_columns import CsvColumns


class Effort(StrEnum):
    """Quantity that drives report as effort: JOINT torque in N m, or MOTOR current in A."""

    TORQUE = "torque"
    CURRENT = "current"

    @classmethod
    def _missing_(cls, value: object) -> Effort:
        raise RecordingError(f"`effort=` is {value!r}: expected {' or '.join(cls)}")


@dataclass(frozen=True, eq=False)
class ReadingOptions:
    """Information about a recording that is not in the file.

    Attributes:
        columns: The columns of a table, as stated for this recording; None to find them.
        effort: Quantity of the effort, for formats that do not specify it.
        joint_names: Names of the arm's joints, if known; columns are matched to them, and of several groups of joints
            the reader takes the one with these.
        episode: Number of the recording in a data set of several.
        position_limits_rad: (n, 2) least and greatest positions of the arm's joints, if known; they tell degrees from
            radians in a data set that states no unit.
        log_columns: The columns of the tables that this arm's logger writes, from the robot's file: its names come
            before names that are recognised, its numbers after them, since they mean a table without names.
    """

    columns: CsvColumns | None = None
    effort: Effort = Effort.TORQUE
    joint_names: Sequence[str] = ()
    episode: int | None = None
    position_limits_rad: FloatArray | None = None
    log_columns: CsvColumns | None = None

    def columns_of(self, recognised: Callable[[], CsvColumns]) -> CsvColumns:
        """The columns of a table whose columns have names.

        Args:
            recognised: Finds them by these names.

        Raises:
            RecordingError: they are not stated, and the names leave something open.
        """
        logged = self.log_columns
        try:
            return self.columns or (logged if logged is not None and logged.by_name else recognised())
        except NamelessColumns:
            if logged is None:
                raise
            return logged
