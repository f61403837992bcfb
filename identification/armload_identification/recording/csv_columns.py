"""The meaning of a table's columns."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Final

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_units import unit_factor, unit_name, units_of

QUANTITIES_BY_KEY: Final = {
    "time": "time_s",
    "position": "position_rad",
    "velocity": "velocity_rad_s",
    "current": "current_a",
    "torque": "torque_nm",
}
"""Quantity by its key in `--columns`: motor currents, joint torques."""
_EXAMPLE: Final = '"time[ms]=0 position[deg]=1-6 torque=7-12" or "time=t position=q1-6 torque=tau1-6"'
_PART: Final = re.compile(r"[^\s=\[]+(?:\[[^\]]*\])?(?:=\S*)?|\S+")
_KEY: Final = re.compile(r"([a-z]+)(?:\[([^\]]*)\])?")
_RANGE: Final = re.compile(r"(.*?)(\d+)-(\d+)")
_MOST_COLUMNS: Final = 1000


@dataclass(frozen=True)
class CsvColumns:
    """The columns of a table (CSV, Parquet, data frame): numbers from zero, or names of a header line.

    Attributes:
        groups: Columns by quantity, in the order of `QUANTITIES_BY_KEY`: of the time in s one, and perhaps one of
            nanoseconds to add to it; of the others one per joint, or one that contains a list of all joints.
        scale: Factor on the numbers of a quantity; 1 if not given.
        joint_names: Names of the joints, if the columns show them.
    """

    groups: Mapping[str, Sequence[int | str]]
    scale: Mapping[str, float] = field(default_factory=dict)
    joint_names: tuple[str, ...] = ()

    @property
    def by_name(self) -> bool:
        """Whether any column is given by the name that it has in the header."""
        return any(isinstance(column, str) for columns in self.groups.values() for column in columns)

    def places(self, path: Path, names: Sequence[str], width: int | None = None) -> dict[str, list[int]]:
        """Numbers of the columns by the name of the quantity.

        Args:
            path: Name of the table in messages.
            names: Names of all columns; the first of several with one name is meant.
            width: Number of columns that the rows have, if that may be another.

        Raises:
            RecordingError: a column that the table does not have.
        """
        found: dict[str, list[int]] = {}
        for quantity, columns in self.groups.items():
            found[quantity] = []
            for column in columns:
                place = column if isinstance(column, int) else names.index(column) if column in names else -1
                if not 0 <= place < (len(names) if width is None else width):
                    one = "the table has one column, as no separator is recognised"
                    there = one if width == 1 else f"there are {', '.join(names)}"
                    raise RecordingError(
                        f"{path}: no column {column!r} for {quantity}; {there}. Correct the name, "
                        "or the number, which starts at 0, or give the right file."
                    )
                found[quantity].append(place)
        return found

    def in_units(self, factors: Mapping[str, float]) -> CsvColumns:
        """The same columns in other units.

        Args:
            factors: Factor on what the columns are read as now, by quantity.
        """
        changed = {name: self.scale.get(name, 1.0) * factor for name, factor in factors.items()}
        return replace(self, scale={**self.scale, **changed})

    def option(self, names: Sequence[str]) -> str:
        """The command-line option that says the same, with numbers of columns.

        Args:
            names: Names of all columns.
        """
        parts = []
        for key, quantity in QUANTITIES_BY_KEY.items():
            columns = self.groups.get(quantity, [])
            factor = self.scale.get(quantity, 1.0)
            unit = f"[{unit_name(quantity, factor)}]" if factor != 1.0 else ""
            places = [column if isinstance(column, int) else names.index(column) for column in columns]
            if places:
                parts.append(f"{key}{unit}={_written(places)}")
        return f'--columns "{" ".join(parts)}"'


def parse_columns(text: str) -> CsvColumns:
    """Columns from the command line.

    Args:
        text: Such as "time[ms]=0 position[deg]=1-6 current=7-12" or "time=t position=q1-6 torque=tau1-6": names and
            numbers separated by commas, or ranges of numbers; SI units if none are given. Two columns of time are
            seconds and nanoseconds.

    Raises:
        RecordingError: naming the part that is invalid.
    """
    found: dict[str, list[int | str]] = {}
    scale: dict[str, float] = {}
    for part in _PART.findall(text):
        left, equals, value = part.partition("=")
        match = _KEY.fullmatch(left)
        key = match[1] if match else ""
        if match is None or key not in QUANTITIES_BY_KEY or not equals or not value or key in found:
            raise RecordingError(
                f"columns: {part!r} is invalid. Write each of {', '.join(QUANTITIES_BY_KEY)} once, such as {_EXAMPLE}."
            )
        if match[2] is not None:
            quantity = QUANTITIES_BY_KEY[key]
            factor = unit_factor(quantity, match[2])
            if factor is None:
                raise RecordingError(
                    f"columns: {left!r} has an unknown unit; {key} can be in {units_of(quantity)}, such as {_EXAMPLE}."
                )
            scale |= {quantity: factor} if factor != 1.0 else {}
        found[key] = [column for item in value.split(",") for column in _expanded(item)]
    if not 1 <= len(found.get("time", ())) <= 2 or "position" not in found:
        raise RecordingError(f"columns: {text!r} lacks the time column or the positions.")
    lengths = {key: len(columns) for key, columns in found.items() if key != "time"}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{count} of {key}" for key, count in lengths.items())
        raise RecordingError(f"columns: there are {listed}; expected as many of each as joints.")
    return CsvColumns({quantity: found[key] for key, quantity in QUANTITIES_BY_KEY.items() if key in found}, scale)


def _expanded(item: str) -> list[int | str]:
    """One column, or those of a range."""
    match = _RANGE.fullmatch(item)
    if match is None:
        return [int(item) if item.isdecimal() and len(item) <= 4 else item]
    stem, first, last = match[1], int(match[2][:6]), int(match[3][:6])
    if not first <= last < first + _MOST_COLUMNS:
        raise RecordingError(f"columns: the range {item!r} is empty; expected the smaller number first.")
    return [f"{stem}{number}" if stem else number for number in range(first, last + 1)]


def _written(places: Sequence[int]) -> str:
    """Numbers of columns, consecutive ones as a range."""
    runs = [[place for _, place in run] for _, run in groupby(enumerate(places), lambda pair: pair[1] - pair[0])]
    return ",".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
