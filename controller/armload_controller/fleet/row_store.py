"""Storage of rows: Parquet with a folder per day, and a journal of the latest rows.

    fleet/day=2026-03-01/3f0c...-0.parquet      rows of recordings of that day
    fleet/journal-3f0c....jsonl                 rows since then, one JSON object per line

A row is on disk, in the journal, before the next is awaited, so a killed coordinator loses none. A journal of
`ROWS_PER_PART` rows is converted to Parquet, one file per day with the journal's name, and removed; after an
interruption the same files are written again. An incomplete last row of a killed process is dropped.
"""

from __future__ import annotations

import json
import os
import secrets
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from armload_controller.control_errors import FleetError
from armload_controller.fleet.recording_row import Row, RowOutcome, column_kinds
from armload_identification.storage.replace_file import replace_file

ROWS_PER_PART: Final = 1000
_JOURNAL_FILES: Final = "journal-*.jsonl"
_PARQUET_FILES: Final = "day=*/*.parquet"
_TIME_COLUMNS: Final = tuple(name for name, kind in column_kinds().items() if kind == "time")


class RowStore:
    """The rows of a fleet in a folder, for one writer at a time.

    Args:
        folder: An existing folder to which no other process writes; `session.folder_claim` ensures this.
        rows_per_part: Greatest number of rows in a journal.

    Raises:
        FleetError: the existing rows cannot be read, or the folder cannot be written to.
    """

    def __init__(self, folder: Path, rows_per_part: int = ROWS_PER_PART) -> None:
        self._folder, self._rows_per_part = folder, rows_per_part
        self._journal: Path | None = None
        self._journal_length = 0
        self._finished_keys: dict[str, str] | None = None
        for journal in sorted(folder.glob(_JOURNAL_FILES)):
            self._to_parquet(journal)

    def __enter__(self) -> RowStore:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.flush()

    def done_keys(self) -> set[str]:
        """Keys of the finished jobs, identified or refused, that are stored as Parquet.

        Only the latest one of each recording: after an exchange of a calibration that is undone, the rows are those of
        the other calibration, and the job has to be repeated.
        """
        if self._finished_keys is None:
            self._finished_keys = _finished(read_rows(self._folder, ("key", "loaded", "outcome", "identified_utc")))
        return set(self._finished_keys.values())

    def add(self, row: Row) -> None:
        """Store a row.

        Args:
            row: A row with the columns of `column_kinds`.

        Raises:
            FleetError: the disk is full, or another error of the file.
        """
        path = self._journal or self._folder / _JOURNAL_FILES.replace("*", secrets.token_hex(8))
        try:
            with path.open("a", encoding="utf-8") as journal:
                self._journal = path  # not before: a file that cannot be created cannot be converted either
                journal.write(json.dumps(row, default=datetime.isoformat, allow_nan=False) + "\n")
                journal.flush()
                os.fsync(journal.fileno())
        except OSError as problem:
            raise FleetError(f"{self._folder}: a row cannot be written ({problem.strerror})") from problem
        self._journal_length += 1
        if self._journal_length >= self._rows_per_part:
            self.flush()

    def flush(self) -> None:
        """Convert the journal to Parquet.

        Raises:
            FleetError: a file cannot be written.
        """
        if self._journal is None:
            return
        journal, self._journal, self._journal_length = self._journal, None, 0
        self._to_parquet(journal)

    def _to_parquet(self, journal: Path) -> None:
        """Write one file per day, and remove the journal."""
        rows = list(_journal_rows(journal))
        by_day: defaultdict[str, list[Row]] = defaultdict(list)
        for row in rows:
            by_day[row["recorded_utc"].date().isoformat()].append(row)
        try:
            for day, of_day in by_day.items():
                folder = self._folder / f"day={day}"
                folder.mkdir(exist_ok=True)
                replace_file(folder / f"{journal.stem.removeprefix('journal-')}.parquet", _parquet_bytes(of_day))
            journal.unlink()
        except OSError as problem:
            raise FleetError(f"{self._folder}: rows cannot be written ({problem.strerror})") from problem
        if self._finished_keys is not None:
            self._finished_keys |= _finished(rows)


def read_rows(folder: Path, columns: Sequence[str]) -> list[Row]:
    """Some columns of all rows.

    Args:
        folder: Folder of a fleet.
        columns: Their names; empty for all.

    Raises:
        FleetError: a file cannot be read.
    """
    import pyarrow.parquet as pq

    rows: list[Row] = []
    for part in sorted(folder.glob(_PARQUET_FILES)):
        try:
            rows += pq.read_table(part, columns=list(columns) or None, partitioning=None).to_pylist()
        except (OSError, ValueError, KeyError) as problem:
            raise FleetError(f"{part}: not a file of `armload fleet` ({problem}); move it away") from problem
    for row in rows:
        row |= {name: row[name].replace(tzinfo=UTC) for name in _TIME_COLUMNS if name in row}
    return rows


def latest_rows(folder: Path, columns: Sequence[str]) -> list[Row]:
    """The row that counts for each recording, see `precedence`, in the order of recording.

    A table names a recording once, so earlier rows with another arm's name are from before that was corrected.

    Args:
        folder: Folder of a fleet.
        columns: Their names; "arm", "loaded", "outcome", "recorded_utc" and "identified_utc" are always included.
    """
    needed = ("arm", "loaded", "outcome", "recorded_utc", "identified_utc")
    rows = read_rows(folder, list(dict.fromkeys([*needed, *columns])))
    rows.sort(key=precedence)
    latest = {row["loaded"]: row for row in rows}
    return sorted(latest.values(), key=lambda row: row["recorded_utc"])


def precedence(row: Row) -> tuple[bool, datetime]:
    """Of several rows of a recording the greatest counts: the latest one, but a failed one only if there is no other.

    While a server is down, every recording on it has failed; once it is back, the jobs are done, as they were before.
    """
    return row["outcome"] != RowOutcome.FAILED.value, row["identified_utc"]


def _finished(rows: Iterable[Row]) -> dict[str, str]:
    """Key of the latest finished job of each recording."""
    finished = (row for row in rows if row["outcome"] != RowOutcome.FAILED.value)
    return {row["loaded"]: row["key"] for row in sorted(finished, key=precedence)}


def _journal_rows(journal: Path) -> Iterator[Row]:
    """The complete rows of a journal."""
    number = 1
    try:
        with journal.open(encoding="utf-8") as lines:
            for line in lines:
                if not line.endswith("\n"):
                    return
                row: Row = {name: _encodable(value) for name, value in json.loads(line).items()}
                yield row | {name: datetime.fromisoformat(row[name]) for name in _TIME_COLUMNS}
                number += 1
    except OSError as problem:
        raise FleetError(f"{journal}: cannot be read ({problem.strerror})") from problem
    except (ValueError, TypeError, KeyError, AttributeError) as problem:
        raise FleetError(
            f"{journal}, line {number}: not a row of `armload fleet` ({problem}); remove the line, or move the "
            "file away: its recordings are then processed again"
        ) from problem


def _parquet_bytes(rows: Iterable[Row]) -> bytes:
    """A Parquet file of rows; every column has the same type in all files."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types: dict[str, Any] = {
        "text": pa.string(),
        "texts": pa.list_(pa.string()),
        "number": pa.float64(),
        "numbers": pa.list_(pa.float64()),
        "count": pa.int64(),
        "truth": pa.bool_(),
        "time": pa.timestamp("us"),  # UTC, without a zone: DuckDB needs another library for those
    }
    schema = pa.schema([(name, types[kind]) for name, kind in column_kinds().items()])
    written = BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), written, compression="zstd")
    return written.getvalue()


def _encodable(value: Any) -> Any:
    """Text that UTF-8 can encode: the bytes of a file's name that are not UTF-8 are written as escapes."""
    if isinstance(value, list):
        return [_encodable(item) for item in value]
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value
