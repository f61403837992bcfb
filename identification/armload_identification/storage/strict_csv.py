"""Strict tables: CSV with a header line of known columns, and a one-sentence error for an invalid line."""

from __future__ import annotations

import csv
import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from armload_identification.storage.strict_toml import FileErrorClass

_OTHER_SEPARATORS: Final = {";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class CsvLine:
    """A line of a table.

    Attributes:
        number: Number of the line in the file.
        text: Text by column; empty if the line has none.
        source: Name of the file in messages.
        error: Makes the error of an invalid line.
    """

    number: int
    text: dict[str, str]
    source: str
    error: FileErrorClass

    def refused(self, column: str, expected: str) -> Exception:
        """The error for what a column contains; `expected` is the end of a sentence."""
        return self.error(self.source, f"line {self.number}, {column}", self.text[column] or None, expected)

    def positive(self, column: str) -> float | None:
        """A number above 0; None if the column is empty. Any other text raises `refused`."""
        try:
            value = float(self.text[column] or "inf")
        except ValueError:
            value = math.nan
        if not 0.0 < value < math.inf and self.text[column]:
            raise self.refused(column, "expected a number above 0, or nothing")
        return value if self.text[column] else None


def parse_csv(
    text: str, source: str, required: Sequence[str], optional: Sequence[str], rows: str, error: FileErrorClass
) -> tuple[CsvLine, ...]:
    """The lines of a table, without empty lines and those that begin with #.

    Args:
        text: CSV.
        source: Name of the table in messages.
        required: Columns that the header must name.
        optional: Columns that it may name.
        rows: Description of the expected rows, for the error of an empty table.
        error: Class of the error raised for an invalid table, naming line, column and value.
    """
    reader = csv.reader(text.splitlines(), skipinitialspace=True)
    try:
        lines = [(reader.line_num, cells) for cells in reader]
    except csv.Error as problem:
        raise error(source, f"line {reader.line_num}", None, f"cannot be read: {problem}") from problem
    header = [name.strip() for name in lines[0][1]] if lines else []
    known = (*required, *optional)
    for separator, called in _OTHER_SEPARATORS.items():
        if len(header) == 1 and separator in header[0]:
            raise error(source, "line 1", header[0], f"columns are separated by {called}; expected commas, all through")
    for number, name in enumerate(header, start=1):
        place = f"line 1, column {number}"
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"; the nearest is '{near[0]}'" if near else ""
            raise error(source, place, name, f"expected one of the columns {', '.join(known)}{hint}")
        if name in header[: number - 1]:
            raise error(source, place, name, "an earlier column has this name; expected each column once")
    for name in required:
        if name not in header:
            raise error(source, f"line 1, {name}", None, f"the header must name {', '.join(required)}")
    found = []
    for number, cells in lines[1:]:
        values = [cell.strip() for cell in cells]
        if not any(values) or values[0].startswith("#"):
            continue
        if len(values) > len(header):
            raise error(source, f"line {number}", ",".join(values), f"expected {len(header)} columns")
        found.append(CsvLine(number, dict.fromkeys(known, "") | dict(zip(header, values, strict=False)), source, error))
    if not found:
        raise error(source, "", None, f"the table has no rows; expected {rows}")
    return tuple(found)
