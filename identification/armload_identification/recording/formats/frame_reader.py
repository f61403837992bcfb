"""Data frames in memory: pandas, polars, or anything else with named columns that NumPy can read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import columns_by_name
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.row_block import RowBlock, hash_of, parts_of


@runtime_checkable
class DataFrame(Protocol):
    """What pandas' and polars' frames have in common."""

    @property
    def columns(self) -> Iterable[Any]:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """One column."""


class FrameReader(RecordingReader):
    """Reads a frame; an index with a name, or of times, as pandas has it, is a column too.

    Args:
        frame: The frame; levels of a name are joined by dots.
        name: Name of the recording in messages.
        options: The columns, recognised by their names if not given, and the names of the arm's joints.

    Raises:
        RecordingError: columns that cannot be recognised, or do not exist.
    """

    kind = "frame"

    def __init__(self, frame: DataFrame, name: Path, options: ReadingOptions) -> None:
        self._name = name
        index = getattr(frame, "index", None)
        if getattr(index, "name", None) is not None:
            frame = frame.reset_index()  # type: ignore[attr-defined]
        elif getattr(getattr(index, "dtype", None), "kind", "") in {"m", "M"}:
            frame = frame.reset_index(names="time")  # type: ignore[attr-defined]
        keys = list(frame.columns)
        self._names = [key if isinstance(key, str) else ".".join(map(str, np.atleast_1d(key))) for key in keys]
        self._columns = options.columns_of(lambda: columns_by_name(name, self._names, options.joint_names))
        self._table = {
            quantity: np.column_stack([self._numbers(frame, keys, place) for place in places])
            for quantity, places in self._columns.places(name, self._names).items()
        }

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`."""
        account.joint_names, account.columns = self._columns.joint_names, (self._columns, self._names)
        account.sha256, account.rows_read = hash_of(self._table), len(self._table["time_s"])
        for part in parts_of(self._table):
            yield RowBlock.of_columns(part, self._columns.scale)

    def _numbers(self, frame: DataFrame, keys: Sequence[Any], place: int) -> FloatArray:
        """(N,) numbers of a column; of durations seconds, of dates seconds since 1970."""
        array = np.asarray(frame[keys[place]])
        try:
            if array.dtype.kind in "mM":
                return 1e-9 * array.astype(f"{array.dtype.kind}8[ns]").astype(np.float64)
            return array.astype(np.float64)
        except (TypeError, ValueError) as error:
            raise RecordingError(f"{self._name}: column {self._names[place]} has no numbers: {error}.") from error
