"""The table of jobs: the arms and their recordings.

A CSV file with a header line. Paths are relative to the table, or URLs such as `s3://bucket/cell-17/loaded.mcap`. In
the columns of recordings `*` matches any part of the name of a file or folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from armload_controller.control_errors import ConfigurationError
from armload_controller.fleet.remote_files import is_url
from armload_identification.storage.strict_csv import CsvLine, parse_csv
from armload_identification.storage.strict_toml import read_text

REQUIRED: Final = ("arm", "robot", "loaded")
RECORDINGS: Final = ("loaded", "unloaded", "validation_loaded", "validation_unloaded")
"""Columns of recordings; the files that match the first define the jobs of a line."""
_OPTIONAL: Final = (*RECORDINGS[1:], "calibration", "payload", "mass_kg")
LARGEST_BYTES: Final = 2**28
"""Greatest size of a table: some million lines."""


@dataclass(frozen=True)
class TableEntry:
    """A line of the table as written there; texts are empty if not given.

    Attributes:
        line: Its number.
        arm: Name of the individual arm.
        robot: A shipped robot, or the path of a robot's file.
        recordings: Path or URL by column of `RECORDINGS`, with `*`.
        calibration: Path or URL of the arm's calibration.
        payload: Name of the payload; arms with payloads of the same name are compared.
        mass_kg: Its mass; None if unknown.
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
        ConfigurationError: the file cannot be read, or a line is invalid; names file, line, column and value.
    """
    return parse_job_table(read_text(path, ConfigurationError, LARGEST_BYTES), str(path))


def parse_job_table(text: str, source: str) -> tuple[TableEntry, ...]:
    """The lines of a table.

    Args:
        text: CSV.
        source: Name of the table, for messages.

    Raises:
        ConfigurationError: as `read_job_table`.
    """
    lines = parse_csv(text, source, REQUIRED, _OPTIONAL, "one or more arms", ConfigurationError)
    return tuple(map(_entry, lines))


def _entry(line: CsvLine) -> TableEntry:
    """One line."""
    text = line.text
    for name in REQUIRED:
        if not text[name]:
            raise line.refused(name, "expected text")
    if is_url(text["robot"]):
        expected = "a shipped robot, or a path that the workers can read; recordings and calibrations may be URLs"
        raise line.refused("robot", f"expected {expected}")
    if "*" in text["calibration"]:
        raise line.refused("calibration", "expected one file: a * has no meaning here")
    missing = [name for name in RECORDINGS[2:] if not text[name]]
    if len(missing) == 1:
        raise line.refused(missing[0], "a validation requires a loaded and an unloaded run; give both")
    return TableEntry(
        line=line.number,
        arm=text["arm"],
        robot=text["robot"],
        recordings={name: text[name] for name in RECORDINGS if text[name]},
        calibration=text["calibration"],
        payload=text["payload"],
        mass_kg=line.positive("mass_kg"),
    )
