"""The table of a calibration: the recordings of an arm, and what the arm carried in each.

A CSV file with a header line and the columns `recording` (path, relative to the table), `mounting` (a name; empty for
an empty arm), `mass_kg` (empty: not weighed) and, for a completely known payload, `payload` (path of its file);
`recorded` is the start of a run, for recordings that do not state it. One name is one payload on the flange, mounted
once.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from armload_identification.identification_errors import RunTableError
from armload_identification.storage.strict_csv import CsvLine, parse_csv
from armload_identification.storage.strict_toml import read_text

_REQUIRED: Final = ("recording", "mounting", "mass_kg")
_OPTIONAL: Final = ("payload", "recorded")


@dataclass(frozen=True)
class TableRow:
    """A row of the table.

    Attributes:
        recording: The file.
        mounting: Name of the mounted payload; empty for an empty arm.
        mass_kg: From a scale; None if it was not weighed.
        payload: Payload file with all ten parameters known; None without one.
        recorded: Date and time at which the run began, ISO 8601; empty if the recording states it, or if unknown.
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
        RunTableError: not readable, or an invalid row, naming file, line, column and value.
    """
    return parse_run_table(read_text(path, RunTableError), str(path), path.parent)


def parse_run_table(text: str, source: str, folder: Path) -> tuple[TableRow, ...]:
    """The rows of a table.

    Args:
        text: CSV.
        source: Its name in messages.
        folder: Folder to which its paths are relative.

    Raises:
        RunTableError: as `read_run_table`.
    """
    lines = parse_csv(text, source, _REQUIRED, _OPTIONAL, "one recording per line", RunTableError)
    rows = [_row(line, folder) for line in lines]
    _require_agreement(rows, source)
    return tuple(rows)


def _row(line: CsvLine, folder: Path) -> TableRow:
    """One line."""
    recording, mounting, payload, recorded = (
        line.text[key] for key in ("recording", "mounting", "payload", "recorded")
    )
    mass_kg = line.positive("mass_kg")
    if not recording:
        raise line.refused("recording", "expected the path of a recording")
    if (mass_kg is not None or payload) and not mounting:
        raise line.refused("mounting", "a run with a mass or a payload must name its mounting")
    try:
        recorded = datetime.fromisoformat(recorded).isoformat() if recorded else ""
    except ValueError:
        expected = "expected a date, or date and time, such as 2026-03-01T08:30, or nothing"
        raise line.refused("recorded", expected) from None
    return TableRow(folder / recording, mounting, mass_kg, folder / payload if payload else None, recorded)


def _require_agreement(rows: list[TableRow], source: str) -> None:
    """Raise unless each recording occurs once and each mounting has one mass."""
    seen: set[Path] = set()
    weighed: dict[str, float] = {}
    for row in rows:
        if row.recording in seen:
            raise RunTableError(source, "recording", str(row.recording), "expected each recording once")
        seen.add(row.recording)
        if row.mass_kg is not None and weighed.setdefault(row.mounting, row.mass_kg) != row.mass_kg:
            known_kg = weighed[row.mounting]
            expected = f"expected {known_kg:g} as in another row; a different payload requires a different name"
            raise RunTableError(source, f"mass_kg of mounting '{row.mounting}'", row.mass_kg, expected)
