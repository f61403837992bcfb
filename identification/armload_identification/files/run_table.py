"""The table of a calibration: which recordings there are of an arm, and what the arm carried in each.

A CSV file with a header line and the columns `recording` (path, relative to the table), `mounting` (a name, empty for
nothing), `mass_kg` (empty: not weighed) and, where a payload is known whole, `payload` (path of its file); `recorded`
says when a run began where its recording does not. One name is one payload on the flange, mounted once.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from armload_identification.identification_errors import RunTableError
from armload_identification.storage.read_file import read_whole

_REQUIRED: Final = ("recording", "mounting", "mass_kg")
_OPTIONAL: Final = ("payload", "recorded")


@dataclass(frozen=True)
class TableRow:
    """A row of the table.

    Attributes:
        recording: The file.
        mounting: Name of what was carried; empty for nothing.
        mass_kg: From a scale; None where it was not weighed.
        payload: Payload file with all ten parameters known; None where there is none.
        recorded: Date and time at which it began, ISO 8601; empty where the recording says it, or nobody does.
    """

    recording: Path
    mounting: str
    mass_kg: float | None
    payload: Path | None
    recorded: str = ""


def read_run_table(path: Path) -> tuple[TableRow, ...]:
    """Read a table of runs.

    Args:
        path: CSV with a header line.

    Returns:
        Its rows, each recording once.

    Raises:
        RunTableError: not readable, or a row that makes no sense, naming file, line, column and value.
    """
    try:
        text = read_whole(path).decode("utf-8-sig")
    except OSError as problem:
        raise RunTableError(str(path), "", None, f"cannot be read: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        raise RunTableError(str(path), "", None, f"cannot be read: no UTF-8, {problem.reason}") from problem
    return parse_run_table(text, str(path), path.parent)


def parse_run_table(text: str, source: str, folder: Path) -> tuple[TableRow, ...]:
    """The rows of a table.

    Args:
        text: CSV.
        source: What messages call it.
        folder: What its paths are relative to.

    Raises:
        RunTableError: as `read_run_table`.
    """
    lines = csv.reader(text.splitlines(), skipinitialspace=True)
    header = [name.strip() for name in next(lines, [])]
    known = (*_REQUIRED, *_OPTIONAL)
    for name in header:
        if name not in known or header.count(name) > 1:
            raise RunTableError(source, "line 1", name, f"expected each of the columns {', '.join(known)} once")
    for name in _REQUIRED:
        if name not in header:
            raise RunTableError(source, f"line 1, {name}", None, f"the header must name {', '.join(_REQUIRED)}")
    rows = []
    for number, cells in enumerate(lines, 2):
        values = [cell.strip() for cell in cells]
        if not any(values) or values[0].startswith("#"):
            continue
        if len(values) > len(header):
            raise RunTableError(source, f"line {number}", ",".join(values), f"expected {len(header)} columns")
        rows.append(_row(dict(zip(header, values, strict=False)), source, number, folder))
    if not rows:
        raise RunTableError(source, "", None, "the table has no rows; expected one recording per line")
    _require_agreement(rows, source)
    return tuple(rows)


def _row(values: dict[str, str], source: str, number: int, folder: Path) -> TableRow:
    """One line."""
    place = f"line {number}"
    recording, mounting = values.get("recording", ""), values.get("mounting", "")
    mass, payload = values.get("mass_kg", ""), values.get("payload", "")
    if not recording:
        raise RunTableError(source, f"{place}, recording", None, "expected the path of a recording")
    if (mass or payload) and not mounting:
        raise RunTableError(source, f"{place}, mounting", None, "a run with a mass or a payload must name its mounting")
    return TableRow(
        folder / recording,
        mounting,
        _mass(mass, source, place) if mass else None,
        folder / payload if payload else None,
        _moment(values.get("recorded", ""), source, place),
    )


def _moment(text: str, source: str, place: str) -> str:
    """A date, or date and time."""
    try:
        datetime.fromisoformat(text or "2000-01-01")
    except ValueError:
        raise RunTableError(
            source,
            f"{place}, recorded",
            text,
            "expected a date, or date and time, such as 2026-03-01T08:30, or nothing",
        ) from None
    return text


def _mass(text: str, source: str, place: str) -> float:
    """A mass in kg."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise RunTableError(source, f"{place}, mass_kg", text, "expected a number above 0, or nothing")
    return value


def _require_agreement(rows: list[TableRow], source: str) -> None:
    """Each recording once, and one mass per mounting."""
    seen: set[Path] = set()
    weighed: dict[str, float] = {}
    for row in rows:
        if row.recording in seen:
            raise RunTableError(source, "recording", str(row.recording), "expected each recording once")
        seen.add(row.recording)
        if row.mass_kg is not None and weighed.setdefault(row.mounting, row.mass_kg) != row.mass_kg:
            raise RunTableError(
                source,
                f"mass_kg of mounting '{row.mounting}'",
                row.mass_kg,
                f"expected {weighed[row.mounting]:g} as in another row; another payload needs another name",
            )
