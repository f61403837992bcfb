"""The meaning of a table's columns."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from armload_identification.identification_errors import RecordingError

_KEYS: Final = ("time", "position", "velocity", "current", "torque")
_RANGE: Final = re.compile(r"(.*?)(\d+)-(\d+)")
_MOST_COLUMNS: Final = 1000


@dataclass(frozen=True)
class CsvColumns:
    """The columns of a table (CSV, Parquet) by quantity: numbers from zero, or names of a header line.

    Attributes:
        time: Column of the time stamp in s.
        position: One column per joint, rad; or one that contains a list of all joints.
        velocity: One per joint, rad/s; None if the log has none.
        current: One per joint, MOTOR current in A; None if the log has torque.
        torque: One per joint, JOINT torque in N m; None if the log has current.
        scale: Factor on the numbers of a quantity, by its name in `groups`; 1 if not given.
        joint_names: Names of the joints, if the columns show them.
    """

    time: int | str
    position: Sequence[int | str]
    velocity: Sequence[int | str] | None = None
    current: Sequence[int | str] | None = None
    torque: Sequence[int | str] | None = None
    scale: Mapping[str, float] = field(default_factory=dict)
    joint_names: tuple[str, ...] = ()

    def groups(self) -> dict[str, list[int | str]]:
        """The existing columns by the name of the quantity."""
        groups = {
            "time_s": [self.time],
            "position_rad": self.position,
            "velocity_rad_s": self.velocity,
            "current_a": self.current,
            "torque_nm": self.torque,
        }
        return {name: list(columns) for name, columns in groups.items() if columns is not None}


def parse_columns(text: str) -> CsvColumns:
    """Columns from the command line.

    Args:
        text: Such as "time=0 position=1-6 current=7-12" or "time=t position=q1-6 torque=tau1-6": names and numbers
            separated by commas, or ranges of numbers.

    Raises:
        RecordingError: naming the part that is invalid.
    """
    found: dict[str, list[int | str]] = {}
    for part in text.split():
        key, equals, value = part.partition("=")
        if key not in _KEYS or not equals or not value or key in found:
            raise RecordingError(
                f"columns: {part!r} is invalid. Write each of {', '.join(_KEYS)} once, such as "
                '"time=0 position=1-6 current=7-12" or "time=t position=q1-6 torque=tau1-6".'
            )
        found[key] = [column for item in value.split(",") for column in _expanded(item)]
    if len(found.get("time", ())) != 1 or "position" not in found:
        raise RecordingError(f"columns: {text!r} lacks the time column or the positions.")
    lengths = {key: len(columns) for key, columns in found.items() if key != "time"}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{count} of {key}" for key, count in lengths.items())
        raise RecordingError(f"columns: there are {listed}; expected as many of each as joints.")
    return CsvColumns(
        found["time"][0], found["position"], found.get("velocity"), found.get("current"), found.get("torque")
    )


def _expanded(item: str) -> list[int | str]:
    """One column, or those of a range."""
    match = _RANGE.fullmatch(item)
    if match is None:
        return [int(item) if item.isdecimal() and len(item) <= 4 else item]
    stem, first, last = match[1], int(match[2][:6]), int(match[3][:6])
    if not first <= last < first + _MOST_COLUMNS:
        raise RecordingError(f"columns: the range {item!r} is empty; expected the smaller number first.")
    return [f"{stem}{number}" if stem else number for number in range(first, last + 1)]
