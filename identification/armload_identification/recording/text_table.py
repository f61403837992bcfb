"""How a text table is written: what separates its columns, which lines are its header, and how it writes times.

Columns are separated by semicolons, tabs, commas or spaces; where a comma does not separate, it is a decimal comma.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import takewhile
from typing import Final, Self

from armload_identification.recording.column_units import unit_factor
from armload_identification.recording.csv_columns import CsvColumns

_SEPARATORS: Final = (";", "\t", ",", " ")
_OPENING_LINES: Final = 64
_HEADER_LINES: Final = 3
"""Lines above the numbers that are joined: names and units, or the levels of pandas' names and that of its index."""
_TIMES_OF_ROWS: Final = "time"
"""Name of a first column that has none and is no number: pandas writes the dates of a frame's index so."""
_STAMP: Final = re.compile(r"([-+\d.eE]+)\s*([a-zA-Zµ]+)")
_ECHO_FIELDS: Final = 3
"""Fields before the joints' names in a message that `ros2 topic echo --csv` printed: seconds, nanoseconds, frame."""


@dataclass(frozen=True)
class TextTable:
    """The form of a table.

    Attributes:
        separator: What separates the columns; a space stands for any white space.
        quoted: Whether fields are in quotation marks.
        header: Names of the columns, with units from the line below; None without a header.
        first_row: Index of the first line of numbers.
    """

    separator: str
    quoted: bool
    header: list[str] | None
    first_row: int

    @classmethod
    def of(cls, lines: Sequence[str]) -> Self:
        """The form of a table.

        Args:
            lines: Its first lines, at least one.
        """
        opening = lines[:_OPENING_LINES]
        quoted = any('"' in line for line in opening)
        separator, first = ",", len(opening)
        for candidate in _SEPARATORS:
            row = next((k for k, line in enumerate(opening) if _is_row(_fields(line, candidate, quoted=quoted))), None)
            if row is not None:
                separator, first = candidate, row
                break
        above = [_fields(line, separator, quoted=quoted) for line in opening[: first + 1]]
        width = len(above[-1])
        text = [fields for fields in above[:first] if len(fields) == width] or above[:first][-1:]
        header = [" ".join(names).strip() for names in zip(*text[-_HEADER_LINES:], strict=True)]
        if header and not header[0] and not is_number(above[-1][0]):
            header[0] = _TIMES_OF_ROWS
        return cls(separator, quoted, header or None, first)

    def with_commas(self, lines: list[str]) -> list[str]:
        """Lines of the table with decimal points, and commas between the columns."""
        if self.separator == "," and not self.quoted:
            return lines
        if self.quoted or self.separator == " ":
            rows = (_fields(line, self.separator, quoted=self.quoted) for line in lines)
            return [",".join(field.replace(",", ".") for field in fields) for fields in rows]
        return [line.replace(",", ".").replace(self.separator, ",") for line in lines]


def echoed_columns(lines: Sequence[str]) -> CsvColumns | None:
    """The columns of joint states as `ros2 topic echo --csv` prints them, without a header; None for other tables.

    Args:
        lines: Lines of the table, separated by commas: seconds, nanoseconds, frame, and the joints' names, positions,
            velocities and efforts; velocities or efforts may be missing.
    """
    fields = [field.strip() for field in lines[0].split(",")] if lines else []
    names = list(takewhile(lambda field: field and not is_number(field), fields[_ECHO_FIELDS:]))
    n = len(names)
    numbers = len(fields) - _ECHO_FIELDS - n
    if n < 2 or len(set(names)) < n or numbers != 3 * n or not all(map(is_number, fields[:2])):
        return None
    position, velocity, effort = (list(range(start, start + n)) for start in range(_ECHO_FIELDS + n, len(fields), n))
    groups = {"time_s": [0, 1], "position_rad": position, "velocity_rad_s": velocity, "torque_nm": effort}
    return CsvColumns(groups, joint_names=tuple(names))


def seconds_of_stamp(text: str) -> float:
    """Seconds from a time with its unit ("0.002 sec"), a clock time ("00:01:02.5"), or a date and time (ISO 8601).

    Args:
        text: The time; a date without a zone is in UTC.

    Raises:
        ValueError: none of these.
    """
    text = text.strip()
    match = _STAMP.fullmatch(text)
    factor = None if match is None else unit_factor("time_s", match[2])
    if match is not None and factor is not None:
        return factor * float(match[1])
    parts = text.split(":")
    if 1 < len(parts) <= 3 and "-" not in text:
        return sum(float(part) * 60.0**power for power, part in enumerate(reversed(parts)))
    moment = datetime.fromisoformat(text)
    return (moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment).timestamp()


def is_number(text: str) -> bool:
    """Whether a field is a number.

    Args:
        text: The field, with a decimal point.
    """
    try:
        float(text)
    except ValueError:
        return False
    return True


def _fields(line: str, separator: str, *, quoted: bool) -> list[str]:
    """The fields of a line."""
    line = line.strip().lstrip("#").lstrip()
    if separator == " ":
        line = " ".join(line.split())
    fields = next(csv.reader([line], delimiter=separator), []) if quoted else line.split(separator)
    return [field.strip() for field in fields]


def _is_row(fields: Sequence[str]) -> bool:
    """Whether a line is a row of numbers: more than one, and at least half of the fields."""
    numbers = sum(is_number(field.replace(",", ".")) for field in fields)
    return numbers > 1 and 2 * numbers >= len(fields)
