"""The table of jobs: which arms there are, and where their recordings lie.

A CSV file with a header line. Paths are relative to the table, or URLs such as `s3://bucket/cell-17/loaded.mcap`. In
the columns of recordings `*` stands for any part of the name of a file or folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from armload_controller.control_errors import ConfigurationError
from armload_identification.storage.strict_csv import CsvLine, parse_csv, read_csv

REQUIRED: Final = ("arm", "robot", "loaded")
RECORDINGS: Final = ("loaded", "unloaded", "validation_loaded", "validation_unloaded")
"""Columns of recordings; the first of them says how many jobs a line is."""
_OPTIONAL: Final = (*RECORDINGS[1:], "calibration", "payload", "mass_kg")
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
    return parse_job_table(read_csv(path, ConfigurationError, LARGEST_BYTES), str(path))


def parse_job_table(text: str, source: str) -> tuple[TableEntry, ...]:
    """The lines of a table.

    Args:
        text: CSV.
        source: What messages call it.

    Raises:
        ConfigurationError: as `read_job_table`.
    """
    lines = parse_csv(text, source, REQUIRED, _OPTIONAL, "one or more arms", ConfigurationError)
    return tuple(_entry(line, source) for line in lines)


def _entry(line: CsvLine, source: str) -> TableEntry:
    """One line."""
    for name in REQUIRED:
        if not line.text(name):
            raise ConfigurationError(source, f"line {line.number}, {name}", None, "expected text")
    if bool(line.text("validation_loaded")) != bool(line.text("validation_unloaded")):
        raise ConfigurationError(
            source,
            f"line {line.number}, validation_loaded",
            None,
            "a validation requires a loaded and an unloaded run; give both",
        )
    return TableEntry(
        line=line.number,
        arm=line.text("arm"),
        robot=line.text("robot"),
        recordings={name: line.text(name) for name in RECORDINGS if line.text(name)},
        calibration=line.text("calibration"),
        payload=line.text("payload"),
        mass_kg=line.positive("mass_kg", source, ConfigurationError),
    )
