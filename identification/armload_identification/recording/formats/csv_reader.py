"""CSV logs of other programs, with every dropped row counted.

Rows that cannot be read are dropped and counted by reason: too few or too many columns (a truncated last row has its
own reason), or text instead of a number. Nothing is filled in. Columns may also be separated by semicolons or tabs, as
spreadsheets write them; a comma is then a decimal comma.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import columns_by_name
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.row_block import RowBlock

_CHUNK_BYTES: Final = 2**18
_BLOCK_LINES: Final = 2**12


class CsvReader:
    """Reads a file of comma, semicolon or tab separated values, with or without a header line.

    Args:
        path: The file.
        columns: The columns; recognised by the header if not given.
    """

    kind = "csv"
    attachments: Mapping[str, str] = {}

    def __init__(self, path: Path, columns: CsvColumns | None) -> None:
        self._path, self._columns = path, columns

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`.

        Raises:
            RecordingError: the file is empty, or a requested column does not exist.
        """
        layout: _Layout | None = None
        separator = ","
        for read, last in self._lines(account):
            if layout is None:
                separator = _separator(read[0])
            lines = read if separator == "," else [_with_commas(line, separator) for line in read]
            if layout is None:
                header = _header(lines[0])
                body = lines if header is None else lines[1:]
                layout = _Layout(self._path, self._columns, header, body)
            else:
                body = lines
            account.rows_read += len(body)
            yield self._block(layout, body, account, last)
        if layout is None:
            raise RecordingError(f"{self._path}: the file is empty. Give a recording with rows of numbers.")
        account.joint_names = layout.joint_names

    def _lines(self, account: ReadingAccount) -> Iterator[tuple[list[str], bool]]:
        """Blocks of lines that are not blank, and whether it is the last block."""
        digest = hashlib.sha256()
        waiting: list[str] = []
        rest = b""
        with self._path.open("rb") as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
                *whole, rest = (rest + chunk).split(b"\n")
                waiting += [text for line in whole if (text := _text(line))]
                # Some lines are always held back, because the last block must not be empty.
                while len(waiting) > _BLOCK_LINES:
                    yield waiting[:_BLOCK_LINES], False
                    waiting = waiting[_BLOCK_LINES:]
        if text := _text(rest):
            waiting.append(text)
        account.sha256 = digest.hexdigest()
        if waiting:
            yield waiting, True

    def _block(self, layout: _Layout, lines: list[str], account: ReadingAccount, last: bool) -> RowBlock:
        """The numbers of the readable lines."""
        separators = np.array([line.count(",") for line in lines], dtype=np.int64)
        whole = separators == layout.expected - 1
        cut = bool(last and lines and separators[-1] < layout.expected - 1)
        account.leave_out(int(cut), "truncated last row")
        account.leave_out(int(np.count_nonzero(~whole)) - int(cut), "wrong number of columns")
        table, unreadable = _numbers([line for line, good in zip(lines, whole, strict=True) if good], layout.wanted)
        account.leave_out(unreadable, "not a number")
        return layout.block(table)


class _Layout:
    """Positions of the wanted numbers in a row, and the number of columns of a complete row."""

    def __init__(self, path: Path, given: CsvColumns | None, header: list[str] | None, lines: list[str]) -> None:
        if given is None and header is None:
            raise RecordingError(
                f"{path}: the table has no header line, so its columns are unknown. "
                'Specify them: --columns "time=0 position=1-6 current=7-12", or a [log] table in the robot\'s file.'
            )
        columns = given or columns_by_name(path, header or [])
        self.joint_names = columns.joint_names
        groups = {name: _indices(path, name, wanted, header) for name, wanted in columns.groups().items()}
        if header is not None:
            self.expected = len(header)
        elif lines:
            self.expected = int(np.bincount([line.count(",") for line in lines]).argmax()) + 1
        else:
            self.expected = 0
        needed = max(max(indices) for indices in groups.values()) + 1
        if lines and needed > self.expected:
            raise RecordingError(
                f"{path}: the rows have {self.expected} columns, but the column map refers to column {needed - 1}. "
                "Correct the column numbers (starting at 0) or give the right file."
            )
        self.wanted = [index for indices in groups.values() for index in indices]
        edges = np.cumsum([0, *(len(indices) for indices in groups.values())])
        self._places = dict(zip(groups, pairwise(edges), strict=True))
        self._scale = columns.scale

    def block(self, table: FloatArray) -> RowBlock:
        """The wanted numbers by quantity."""
        parts = {name: self._scale.get(name, 1.0) * table[:, first:end] for name, (first, end) in self._places.items()}
        return RowBlock.of_columns(parts)


def _text(line: bytes) -> str:
    """A line without its ending; empty if it is blank."""
    text = line.decode("utf-8", errors="replace").rstrip("\r")
    return text if text.strip() else ""


def _separator(first_line: str) -> str:
    """What separates the columns."""
    return next((separator for separator in (";", "\t") if separator in first_line), ",")


def _with_commas(line: str, separator: str) -> str:
    """A line with decimal points, and commas between the columns."""
    return line.replace(",", ".").replace(separator, ",")


def _header(first_line: str) -> list[str] | None:
    """Names of the columns, or None if the first line is data: a header contains no number."""
    fields = [text.strip().strip('"') for text in first_line.split(",")]
    for text in fields:
        try:
            float(text)
        except ValueError:
            continue
        return None
    return fields


def _indices(path: Path, quantity: str, wanted: Sequence[int | str], header: list[str] | None) -> list[int]:
    indices = []
    for column in wanted:
        if isinstance(column, int):
            indices.append(column)
        elif header is None:
            raise RecordingError(
                f"{path}: there is no header line, so the column '{column}' for {quantity} cannot be found. "
                "Give column numbers, starting at 0."
            )
        elif column not in header:
            raise RecordingError(
                f"{path}: no column '{column}' for {quantity}; the header has {', '.join(header)}. "
                "Correct the column map."
            )
        else:
            indices.append(header.index(column))
    return indices


def _numbers(lines: list[str], wanted: list[int]) -> tuple[FloatArray, int]:
    """(rows, len(wanted)) numbers, and the number of lines that contain text instead."""
    if not lines:
        return np.empty((0, len(wanted))), 0
    try:
        return np.loadtxt(lines, delimiter=",", usecols=wanted, ndmin=2, comments=None), 0
    except ValueError:
        pass
    rows = []
    for line in lines:
        fields = line.split(",")
        try:
            rows.append([float(fields[index]) for index in wanted])
        except ValueError:
            continue
    return np.array(rows, dtype=np.float64).reshape(-1, len(wanted)), len(lines) - len(rows)
