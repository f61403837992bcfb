"""Parquet tables, and LeRobot's data sets (v3), which are such tables with a description.

Columns are recognised by name, as in any table; a column may contain a list with a number for each joint, such as
LeRobot's `observation.state`.

References:
    LeRobotDataset v3: `meta/info.json`, `data/chunk-*/file-*.parquet`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_names import arrays_by_name, columns_by_name
from armload_identification.recording.column_units import DEGREE_RAD, unit_factor
from armload_identification.recording.csv_columns import QUANTITIES_BY_KEY, CsvColumns
from armload_identification.recording.joint_names import JointNames
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.row_block import BLOCK_ROWS, RowBlock
from armload_identification.storage.regular_file import hash_of_files, read_whole

INFO: Final = Path("meta") / "info.json"
"""Description of a LeRobot data set, relative to its folder."""
_EPISODE: Final = "episode_index"
_PANDAS_INDEX: Final = "__index_level_0__"
"""Name under which pandas writes an index without a name."""
_ANGLES: Final = {"position_rad", "velocity_rad_s"}
_NORMALISED: Final = 100.0
"""End of the range of a joint that LeRobot records in percent."""
_SLACK_RAD: Final = 0.1
"""How far a position may be beyond a limit."""


class ParquetReader(RecordingReader):
    """Reads a table, or the data of a LeRobot folder.

    Args:
        path: The file, or the folder of a data set.
        options: The columns, recognised by their names if not given; the episode to read, if there are several; and the
            arm's joints.

    Raises:
        RecordingError: not readable, several episodes of which none is chosen, or an episode that does not exist.
    """

    kind = "parquet"

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self._path, self._episode, self._options = path, options.episode, options
        info, self._files = _described(path) if path.is_dir() else ({}, [path])
        self._schema = pq.ParquetFile(self._files[0]).schema_arrow
        self._names = [
            "time" if field.name == _PANDAS_INDEX and _holds_times(field.type) else field.name for field in self._schema
        ]
        self._require_episode()
        self._remarks: tuple[str, ...] = ()
        self._columns = options.columns_of(lambda: self._recognised(info))

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`.

        Raises:
            RecordingError: damaged, or columns that do not exist.
        """
        places = self._columns.places(self._path, self._names)
        groups = {name: [self._schema.names[place] for place in columns] for name, columns in places.items()}
        wanted = [column for columns in groups.values() for column in columns]
        account.remarks = self._remarks
        account.joint_names, account.columns = self._columns.joint_names, (self._columns, self._names)
        account.sha256 = hash_of_files(self._files)
        if self._episode is not None:
            account.sha256 = hashlib.sha256(f"{account.sha256} episode {self._episode}".encode()).hexdigest()
            wanted.append(_EPISODE)
        for batch in self._batches(wanted):
            if self._episode is not None:
                batch = batch.filter(pc.equal(batch.column(_EPISODE), self._episode))  # noqa: PLW2901
            account.rows_read += batch.num_rows
            if batch.num_rows:
                yield self._block(batch, groups)

    def _batches(self, columns: Sequence[str]) -> Iterator[Any]:
        """Some columns of the files, some thousand rows at a time."""
        for file in self._files:
            yield from pq.ParquetFile(file).iter_batches(BLOCK_ROWS, columns=list(dict.fromkeys(columns)))

    def _block(self, batch: Any, groups: Mapping[str, Sequence[str]]) -> RowBlock:
        """Numbers of a batch."""
        parts = {name: np.hstack([_numbers(batch.column(c)) for c in columns]) for name, columns in groups.items()}
        return RowBlock.of_columns(parts, self._columns.scale)

    def _recognised(self, info: Mapping[str, Any]) -> CsvColumns:
        """Columns by their names: lists first, then one per joint."""
        names = self._names
        lists = arrays_by_name({field.name for field in self._schema if _holds_lists(field.type)})
        time, position = arrays_by_name(names).get("time_s"), lists.get("position_rad")
        if position is None or time is None:
            return columns_by_name(self._path, names, self._options.joint_names)
        named = lists | {"time_s": time}
        groups = {name: [named[name]] for name in QUANTITIES_BY_KEY.values() if name in named}
        columns = CsvColumns(groups, joint_names=_joints_of(info, position))
        limits = self._options.position_limits_rad
        return columns if limits is None or not info else self._in_stated_unit(columns, position, limits)

    def _in_stated_unit(self, columns: CsvColumns, position: str, limits_rad: FloatArray) -> CsvColumns:
        """The columns in the unit that the positions of a LeRobot data set must have, as it does not state one."""
        places = JointNames(self._options.joint_names).places(columns.joint_names)
        chosen = [places[joint] for joint in sorted(places)]
        parts = (_numbers(batch.column(0))[:, chosen] for batch in self._batches([position]))
        ends = [(values.min(axis=0), values.max(axis=0)) for values in parts]
        if not ends or not chosen:
            return columns
        low, high = np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))
        least, most = np.clip(limits_rad[sorted(places)], -2.0 * np.pi, 2.0 * np.pi).T

        def within(unit_rad: float) -> bool:
            return bool((unit_rad * low >= least - _SLACK_RAD).all() and (unit_rad * high <= most + _SLACK_RAD).all())

        if within(1.0) or not within(DEGREE_RAD):
            return columns
        in_degrees = columns.in_units({key: DEGREE_RAD for key in columns.groups if key in _ANGLES})
        if np.count_nonzero((low == -_NORMALISED) | (high == _NORMALISED)) > 1:
            raise RecordingError(
                f"{self._path}: {position} ends at exactly -{_NORMALISED:g} or {_NORMALISED:g}, so it may be in "
                f"percent of each joint's range. If it is in degrees, say so: {in_degrees.option(self._names)}."
            )
        self._remarks = (
            f"{position} reaches {max(-low.min(), high.max()):.4g}, beyond the arm's limits in radians and within them "
            "in degrees: it was read in degrees.",
        )
        return in_degrees

    def _require_episode(self) -> None:
        """Raise for several episodes of which none is chosen, and for a choice that does not exist."""
        episodes: set[int] = set()
        if _EPISODE in self._names:
            for batch in self._batches([_EPISODE]):
                episodes.update(batch.column(0).unique().to_pylist())
        if self._episode is None and len(episodes) > 1:
            raise RecordingError(
                f"{self._path}: {len(episodes)} episodes ({_numbered(episodes)}), each of which is a separate "
                "recording. Choose one for each recording with `episode=`, such as 3."
            )
        if self._episode is not None and self._episode not in episodes:
            there = f"there are {_numbered(episodes)}" if episodes else f"no column {_EPISODE}"
            raise RecordingError(f"{self._path}: no episode {self._episode}, {there}. Correct `episode=`.")


def _numbered(episodes: set[int]) -> str:
    """Numbers of episodes, as a range if they are consecutive."""
    first, last = min(episodes), max(episodes)
    whole = last - first + 1 == len(episodes)
    return f"{first} to {last}" if whole else ", ".join(map(str, sorted(episodes)))


def _described(folder: Path) -> tuple[Mapping[str, Any], list[Path]]:
    """Description and tables of a LeRobot data set."""
    try:
        info = json.loads(read_whole(folder / INFO))
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(f"{folder / INFO}: cannot be read: {error}. Copy the data set again.") from error
    files = sorted((folder / "data").glob("chunk-*/file-*.parquet"))
    if not files or not isinstance(info, dict):
        raise RecordingError(f"{folder}: no data/chunk-*/file-*.parquet, as in LeRobot data sets of version 3.")
    return info, files


def _joints_of(info: Mapping[str, Any], column: str) -> tuple[str, ...]:
    """Names of the joints in a LeRobot column, such as "elbow.pos"; empty if the description has none."""
    try:
        names = info["features"][column]["names"]
        names = next(iter(names.values())) if isinstance(names, dict) else names
        return tuple(str(name).removesuffix(".pos") for name in names)
    except (KeyError, TypeError, StopIteration):
        return ()


def _holds_times(kind: Any) -> bool:
    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def _holds_lists(kind: Any) -> bool:
    return bool(pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind))


def _numbers(column: Any) -> FloatArray:
    """(N, k) numbers of a column, k above 1 for lists, of times in s; NaN for missing numbers."""
    if _holds_times(column.type):
        return (unit_factor("time_s", column.type.unit) or 1.0) * _numbers(column.cast(pa.int64()))
    if not _holds_lists(column.type):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)).reshape(-1, 1)
    flat = column.flatten().cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    if len(column) == 0 or flat.size % len(column) or column.null_count:
        raise ValueError("a list without a number for each joint")
    lengths = column.value_lengths().to_numpy(zero_copy_only=False)
    if not (lengths == lengths[0]).all():
        raise ValueError("lists of different lengths")
    return np.asarray(flat, dtype=np.float64).reshape(len(column), -1)
