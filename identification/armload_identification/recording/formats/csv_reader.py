"""Tables of numbers as text, with every dropped row counted.

Rows that cannot be read are dropped and counted by reason: too few or too many columns (a truncated last row has its
own reason), or text instead of a number. Nothing is filled in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import columns_by_name
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.row_block import RowBlock
from armload_identification.recording.text_table import TextTable, echoed_columns, is_number, seconds_of_stamp
from armload_identification.storage.regular_file import hash_of_files

_LONGEST_LINE_BYTES: Final = 2**20
_BLOCK_LINES: Final = 2**12
_REASONS: Final = ("truncated last row", "wrong number of columns", "not a number")


class CsvReader(RecordingReader):
    """Reads a table with or without a header line.

    Args:
        options: The columns, recognised by the header if not given, and the names of the arm's joints.
    """

    kind = "csv"

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self._path, self._options = path, options

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`.

        Raises:
            RecordingError: the file is empty, or a requested column does not exist.
        """
        account.sha256 = hash_of_files([self._path])
        blocks = self._lines()
        read, last = next(blocks, ([], True))
        if not read:
            raise RecordingError(f"{self._path}: the file is empty. Give a recording with rows of numbers.")
        table = TextTable.of(read)
        first = table.with_commas(read[table.first_row :])
        layout = _Layout(self._path, self._options, table.header, first)
        account.columns, account.joint_names = (layout.columns, layout.names), layout.columns.joint_names
        others = ((table.with_commas(lines), at_end) for lines, at_end in blocks)
        for lines, at_end in chain([(first, last)], others):
            account.rows_read += len(lines)
            yield self._block(layout, lines, account, at_end)

    def _lines(self) -> Iterator[tuple[list[str], bool]]:
        """Blocks of lines that are not blank, and whether it is the last block."""
        with self._path.open("rb") as file:
            lines = filter(None, map(_text, iter(partial(file.readline, _LONGEST_LINE_BYTES + 1), b"")))
            block = list(islice(lines, _BLOCK_LINES))
            while block:
                following = list(islice(lines, _BLOCK_LINES))
                yield block, not following
                block = following

    def _block(self, layout: _Layout, lines: list[str], account: ReadingAccount, last: bool) -> RowBlock:
        """The numbers of the readable lines."""
        separators = np.array([line.count(",") for line in lines], dtype=np.int64)
        whole = separators == layout.expected - 1
        cut = int(bool(last and lines and separators[-1] < layout.expected - 1))
        table, unreadable = layout.numbers([line for line, good in zip(lines, whole, strict=True) if good])
        counts = (cut, int(np.count_nonzero(~whole)) - cut, unreadable)
        account.reasons += Counter(dict(zip(_REASONS, counts, strict=True)))
        return layout.block(table)


class _Layout:
    """Positions of the wanted numbers in a row, and the number of columns of a complete row."""

    def __init__(self, path: Path, options: ReadingOptions, header: list[str] | None, lines: list[str]) -> None:
        counts = [line.count(",") + 1 for line in lines]
        self.expected = int(np.bincount(counts).argmax()) if counts else len(header or ())
        self.names = header or [str(place) for place in range(self.expected)]
        given = options.columns or options.log_columns or echoed_columns(lines)
        if given is None and header is None:
            raise RecordingError(
                f"{path}: the table has no header line, so its {self.expected} columns are unknown. Specify them, for "
                'example --columns "time=0 position=1-6 current=7-12", or a [log] table in the robot\'s file.'
            )
        if given is None or header is not None:
            given = options.columns_of(lambda: columns_by_name(path, self.names, options.joint_names))
        self.columns = given
        groups = self.columns.places(path, self.names, self.expected)
        if lines and self.columns.by_name and options.columns is None and len(self.names) != self.expected:
            raise RecordingError(
                f"{path}: the header has {len(self.names)} columns, the rows have {self.expected}. Specify the columns "
                f"by the numbers that they have in the rows, from 0, such as {self.columns.option(self.names)}."
            )
        self._wanted = [index for indices in groups.values() for index in indices]
        edges = np.cumsum([0, *(len(indices) for indices in groups.values())])
        self._places = dict(zip(groups, pairwise(edges), strict=True))
        first = next((line.split(",") for line in lines if line.count(",") == self.expected - 1), None)
        self._stamped = first is not None and not is_number(first[self._wanted[0]])

    def numbers(self, lines: list[str]) -> tuple[FloatArray, int]:
        """(rows, columns) wanted numbers, and the number of lines that contain text instead."""
        if not lines:
            return np.empty((0, len(self._wanted))), 0
        times: dict[int | str, Callable[[str], float]] = {self._wanted[0]: seconds_of_stamp} if self._stamped else {}
        with suppress(ValueError):
            return np.loadtxt(lines, delimiter=",", usecols=self._wanted, ndmin=2, comments=None, converters=times), 0
        rows = []
        for line in lines:
            fields = line.split(",")
            first, *others = (fields[index] for index in self._wanted)
            try:
                rows.append([seconds_of_stamp(first) if self._stamped else float(first), *map(float, others)])
            except ValueError:
                continue
        return np.array(rows, dtype=np.float64).reshape(-1, len(self._wanted)), len(lines) - len(rows)

    def block(self, table: FloatArray) -> RowBlock:
        """The wanted numbers by quantity."""
        parts = {name: table[:, first:end] for name, (first, end) in self._places.items()}
        return RowBlock.of_columns(parts, self.columns.scale)


def _text(line: bytes) -> str:
    """A line without its ending; empty if it is blank."""
    if len(line) > _LONGEST_LINE_BYTES:
        raise ValueError(f"a line of more than {_LONGEST_LINE_BYTES} bytes, so it is no table")
    try:
        text = line.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = line.decode("cp1252", errors="replace")
    return text.rstrip("\r\n") if text.strip() else ""
