"""The runs for an arm's calibration, with payloads from a table or from the recordings themselves."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from armload_controller.config.objects_or_paths import FilePath, recording_of
from armload_controller.config.robot_recordings import MeasuredArm
from armload_controller.control_errors import CommissioningError
from armload_identification.calibration.mounted_runs import ArmRuns, MountedRun, WeighedPayload
from armload_identification.files.payload_file import read_payload
from armload_identification.files.run_table import TableRow, read_run_table
from armload_identification.identification_errors import IdentificationError, RunTableError
from armload_identification.recording.recording import Recording

_RECORDING_COLUMN = b"recording"
_LOADED, UNLOADED = "loaded", "unloaded"

T = TypeVar("T")


def is_run_table(path: Path) -> bool:
    """Whether a file is a table of runs: its first line names the column `recording`, with any separator."""
    try:
        with path.open("rb") as file:
            line = file.readline().removeprefix(b"\xef\xbb\xbf")
            return _RECORDING_COLUMN in [cell.strip() for cell in re.split(rb"[,;\t]", line)]
    except OSError:
        return False


def listed_runs(
    given: Sequence[Recording | FilePath],
) -> tuple[tuple[tuple[Recording | FilePath, TableRow], ...], bool]:
    """The recordings with their rows, and whether these are from a table, which states their mountings.

    Args:
        given: One table of runs, or recordings.

    Raises:
        RunTableError: the table is invalid, or is given together with recordings.
    """
    paths = [run.source.path if isinstance(run, Recording) else Path(run) for run in given]
    tables = [path for path in paths if is_run_table(path)]
    if not tables:
        rows = (TableRow(path, "", None, None) for path in paths)
        return tuple(zip(given, rows, strict=True)), False
    if len(paths) > 1:
        expected = "a table of runs cannot be combined with recordings; add the recordings to the table"
        raise RunTableError(str(tables[0]), "", None, expected)
    return tuple((row.recording, row) for row in read_run_table(tables[0])), True


def read_runs(
    robot: MeasuredArm, given: Sequence[Recording | FilePath], progress: Callable[[int, int], None] | None = None
) -> ArmRuns:
    """Read all runs of an arm.

    Args:
        given: One table of runs, or recordings that state their payload.
        progress: Called with the number of recordings read and their total.

    Returns:
        The runs; a recording that cannot be read is named in `left_out`.

    Raises:
        RunTableError: the table is invalid, is given together with recordings, or a recording states no payload.
        FileError: a payload file cannot be used.
    """
    listed, from_table = listed_runs(given)

    def mounted(recording: Recording, row: TableRow) -> MountedRun:
        return MountedRun(recording, row.mounting if from_table else _mounting_of(recording), row.recorded)

    runs, left_out = of_usable(robot, listed, mounted, progress)
    weighed = _weighed([row for _, row in listed]) if from_table else _weighed_as_recorded(runs)
    return ArmRuns(tuple(runs), weighed, left_out)


def of_usable(
    robot: MeasuredArm,
    listed: Sequence[tuple[Recording | FilePath, TableRow]],
    made: Callable[[Recording, TableRow], T],
    progress: Callable[[int, int], None] | None,
) -> tuple[list[T], tuple[tuple[str, str], ...]]:
    """What is made of each listed recording, and name and reason of each that cannot be used.

    Args:
        listed: Recordings with their rows.
        made: Makes it; may refuse a recording.
        progress: Called with the number of recordings read and their total.
    """
    found, left_out = [], []
    for done, (run, row) in enumerate(listed, 1):
        try:
            found.append(made(recording_of(robot, run, "runs"), row))
        except (IdentificationError, CommissioningError) as problem:
            left_out.append((row.recording.name, str(problem).removeprefix(f"{row.recording}: ")))
        if progress is not None:
            progress(done, len(listed))
    return found, tuple(left_out)


def runs_of_commissioning(recordings: Sequence[Recording], mass_kg: float | None) -> ArmRuns:
    """Runs of one commissioning, with the mass that it was given last.

    A mass that contradicts the data is refused after the recordings were made. They still state it, but it must not
    enter a calibration.

    Args:
        mass_kg: Mass of the payload; None if it was not weighed.

    Raises:
        RunTableError: a recording does not state whether it was loaded.
    """
    runs = tuple(MountedRun(recording, _mounting_of(recording)) for recording in recordings)
    weighed = {} if mass_kg is None else {run.mounting: WeighedPayload(mass_kg) for run in runs if run.mounting}
    return ArmRuns(runs, weighed)


def masses_otherwise_recorded(recordings: Sequence[Recording], mass_kg: float | None) -> tuple[float, ...]:
    """Masses in kg that recordings of a payload state and that are not its mass.

    Args:
        mass_kg: Mass of the payload; None if it was not weighed.
    """
    said = {recording.source.run().get("mass_kg") for recording in recordings}
    return tuple(sorted(float(mass) for mass in said if mass is not None and mass != mass_kg))


def _mounting_of(recording: Recording) -> str:
    """The mounting that a recording states: its folder's name if loaded, empty if unloaded."""
    load = recording.source.run().get("load")
    if load == UNLOADED:
        return ""
    if load == _LOADED:
        return recording.source.path.resolve().parent.name or _LOADED
    raise RunTableError(
        str(recording.source.path),
        "",
        None,
        "the recording does not state what the arm carried; give a table of runs (CSV) with the columns recording, "
        "mounting, mass_kg",
    )


def _weighed_as_recorded(runs: Sequence[MountedRun]) -> dict[str, WeighedPayload]:
    """Masses that the recordings state, by mounting."""
    said = {run.mounting: run.recording.source.run().get("mass_kg") for run in runs if run.mounting}
    return {name: WeighedPayload(float(mass_kg)) for name, mass_kg in said.items() if mass_kg is not None}


def _weighed(rows: Sequence[TableRow]) -> dict[str, WeighedPayload]:
    """Masses and payload files from the table, by mounting."""
    weighed: dict[str, WeighedPayload] = {}
    for row in rows:
        if row.payload is not None:
            whole = read_payload(row.payload).model
            weighed[row.mounting] = WeighedPayload(row.mass_kg or whole.mass_kg, whole)
        elif row.mass_kg is not None:
            weighed.setdefault(row.mounting, WeighedPayload(row.mass_kg))
    return weighed
