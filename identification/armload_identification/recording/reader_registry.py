"""The recording formats there are. A new one is a reader in a file of its own, and its line here."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.csv_reader import open_csv
from armload_identification.recording.reader import ReaderFactory, RecordingReader
from armload_identification.recording.run_format import MAGIC
from armload_identification.storage.read_file import require_regular


def open_mcap(path: Path, start: bytes, columns: CsvColumns | None) -> RecordingReader | None:
    """The reader of armload's own recordings; its libraries are loaded for such a file only."""
    del columns
    if not start.startswith(MAGIC):
        return None
    from armload_identification.recording.mcap_reader import McapReader

    return McapReader(path)


READERS: Final[tuple[ReaderFactory, ...]] = (open_mcap, open_csv)
"""In this order: a file belongs to the first that takes it, and a table has no signature to recognise it by."""
_START_BYTES: Final = 4096


def reader_of(path: Path, columns: CsvColumns | None) -> RecordingReader:
    """The reader of a file.

    Args:
        path: The file.
        columns: Column map of tables, or None.

    Raises:
        RecordingError: the file cannot be opened, is empty, or is of no known format.
    """
    try:
        require_regular(path)
        with path.open("rb") as file:
            start = file.read(_START_BYTES)
            blank = not start.strip() and not any(rest.strip() for rest in iter(lambda: file.read(_START_BYTES), b""))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}). Check the path.") from error
    if blank:
        raise RecordingError(f"{path}: the file is empty. Give a recording with rows of numbers.")
    for factory in READERS:
        reader = factory(path, start, columns)
        if reader is not None:
            return reader
    raise RecordingError(
        f"{path}: not an MCAP file, and the configuration has no column map for CSV files. "
        "Give a recording made by armload, or add a [log] table to the robot's configuration."
    )
