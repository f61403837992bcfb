"""Foreign CSV logs as one table of numbers, with every row that is left out accounted for.

Rows that cannot be read are dropped and counted by reason: too few or too many columns (a cut last row has
its own reason), or text where a number should be. Nothing is guessed or filled in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError


@dataclass(frozen=True)
class CsvContent:
    """What a CSV file holds.

    Attributes:
        values: Per quantity (rows, width), all of one length.
        rows_read: Data rows in the file, good or bad.
        reasons: Rows left out, counted by reason.
    """

    values: dict[str, FloatArray]
    rows_read: int
    reasons: Mapping[str, int] = field(default_factory=dict)


def read_columns(path: Path, columns: Mapping[str, Sequence[int | str]]) -> CsvContent:
    """Read the wanted columns of a comma separated file.

    Args:
        path: The file.
        columns: Per quantity its columns: numbers from zero, or names of the header line.

    Returns:
        The numbers of every readable row, in the order of the file.

    Raises:
        RecordingError: the file is empty, or a wanted column does not exist.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise RecordingError(f"{path}: the file is empty. Give a recording with rows of numbers.")
    header = _header(lines[0])
    if header is not None:
        lines = lines[1:]
    groups = {name: _indices(path, name, wanted, header) for name, wanted in columns.items()}
    separators = np.array([line.count(",") for line in lines], dtype=np.int64)
    expected = len(header) if header is not None else int(np.bincount(separators).argmax()) + 1 if lines else 0
    needed = max(max(indices) for indices in groups.values()) + 1
    if lines and needed > expected:
        raise RecordingError(
            f"{path}: the rows have {expected} columns, but the column map asks for column {needed - 1}. "
            "Correct the column numbers (they begin at 0) or give the right file."
        )
    reasons: Counter[str] = Counter()
    whole = separators == expected - 1
    if lines and not whole[-1] and separators[-1] < expected - 1:
        reasons["cut last row"] += 1
    wrong = int(np.count_nonzero(~whole)) - reasons["cut last row"]
    if wrong:
        reasons["wrong number of columns"] += wrong
    wanted = [index for indices in groups.values() for index in indices]
    table, unreadable = _numbers([line for line, good in zip(lines, whole, strict=True) if good], wanted)
    if unreadable:
        reasons["not a number"] += unreadable
    values = {}
    position = 0
    for name, indices in groups.items():
        values[name] = table[:, position : position + len(indices)]
        position += len(indices)
    return CsvContent(values=values, rows_read=len(lines), reasons=dict(reasons))


def _header(first_line: str) -> list[str] | None:
    """Names of the columns, or None where the first line is data: a header has no number in it."""
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
                "Give column numbers, beginning at 0."
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
    """(rows, len(wanted)) numbers and how many lines held text instead."""
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
