"""The table of jobs: which arms there are, and where their recordings lie.

A CSV file with a header line. Paths are relative to the table, or URLs such as `s3://bucket/cell-17/loaded.mcap`. In
the columns of recordings `*` stands for any part of the name of a file or folder.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from armload_controller.control_errors import ConfigurationError
from armload_identification.storage.read_file import read_whole

REQUIRED: Final = ("arm", "robot", "loaded")
RECORDINGS: Final = ("loaded", "unloaded", "validation_loaded", "validation_unloaded")
"""Columns of recordings; the first of them says how many jobs a line is."""
_KNOWN: Final = ("arm", "robot", *RECORDINGS, "calibration", "payload", "mass_kg")
LARGEST_BYTES: Final = 2**28
"""Of a table: some million lines."""


@dataclass(frozen=True)
class TableEntry:
    """A line of the table, as it is written there; empty where it says nothing.

    Attributes:
        line: Its number.
        arm: Name of the one arm that it is about.
        robot: A shipped robot, or the path of a robot's file.
        recordings: Path or URL by column of `RECORDINGS`, with `*`.
        calibration: Path or URL of the arm's calibration.
        payload: Name of what is carried; arms that carry payloads of one name are compared.
        mass_kg: Its mass where it is known beforehand; None where it is not.
    """

    line: int
    arm: str
    robot: str
    recordings: dict[str, str]
    calibration: str
    payload: str
    mass_kg: float | None


def read_job_table(path: Path) -> tuple[TableEntry, ...]:
    """Read a table of jobs.

    Args:
        path: CSV with a header line.

    Raises:
        ConfigurationError: not readable, or a line that makes no sense, naming file, line, column and value.
    """
    try:
        text = read_whole(path, LARGEST_BYTES).decode("utf-8-sig")
    except OSError as problem:
        raise ConfigurationError(str(path), "", None, f"cannot be read: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        raise ConfigurationError(str(path), "", None, f"cannot be read: no UTF-8, {problem.reason}") from problem
    return parse_job_table(text, str(path))


def parse_job_table(text: str, source: str) -> tuple[TableEntry, ...]:
    """The lines of a table.

    Args:
        text: CSV.
        source: What messages call it.

    Raises:
        ConfigurationError: as `read_job_table`.
    """
    lines = csv.reader(text.splitlines(), skipinitialspace=True)
    header = [name.strip() for name in next(lines, [])]
    for name in header:
        if name not in _KNOWN or header.count(name) > 1:
            raise ConfigurationError(source, "line 1", name, f"expected each of the columns {', '.join(_KNOWN)} once")
    for name in REQUIRED:
        if name not in header:
            raise ConfigurationError(source, f"line 1, {name}", None, f"the header must name {', '.join(REQUIRED)}")
    entries = []
    for cells in lines:
        values = [cell.strip() for cell in cells]
        if not any(values) or values[0].startswith("#"):
            continue
        if len(values) > len(header):
            raise ConfigurationError(
                source, f"line {lines.line_num}", ",".join(values), f"expected {len(header)} columns"
            )
        entries.append(_entry(dict(zip(header, values, strict=False)), source, lines.line_num))
    if not entries:
        raise ConfigurationError(source, "", None, "the table has no lines; expected one or more arms")
    return tuple(entries)


def _entry(values: dict[str, str], source: str, line: int) -> TableEntry:
    """One line."""
    for name in REQUIRED:
        if not values.get(name):
            raise ConfigurationError(source, f"line {line}, {name}", None, "expected a text")
    if bool(values.get("validation_loaded")) != bool(values.get("validation_unloaded")):
        raise ConfigurationError(
            source, f"line {line}, validation_loaded", None, "a validation is a loaded and an unloaded run; give both"
        )
    mass = values.get("mass_kg", "")
    return TableEntry(
        line=line,
        arm=values["arm"],
        robot=values["robot"],
        recordings={name: values[name] for name in RECORDINGS if values.get(name)},
        calibration=values.get("calibration", ""),
        payload=values.get("payload", ""),
        mass_kg=_mass(mass, source, line) if mass else None,
    )


def _mass(text: str, source: str, line: int) -> float:
    """A mass in kg."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise ConfigurationError(source, f"line {line}, mass_kg", text, "expected a number above 0, or nothing")
    return value
