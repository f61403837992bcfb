"""ROS bags: of ROS 2, a folder or one of its storage files; of ROS 1, a file.

The messages read are `sensor_msgs/JointState`, `control_msgs/DynamicJointState` and
`control_msgs/JointTrajectoryControllerState`. Joints are matched by name in every message, as their order may change.
Several nodes may publish on one topic, such as arm and gripper: one of the groups of joints that occur together is
used, and messages without all of its joints are skipped.
"""

from __future__ import annotations

import os
import re
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from io import BytesIO
from itertools import accumulate, compress, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeVar

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats.mcap_reader import require_small_chunks
from armload_identification.recording.formats.unpacking import require_bounded, unpacked
from armload_identification.recording.joint_names import JointNames
from armload_identification.recording.read_boundary import MOST_BYTES
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.reading_options import Effort, ReadingOptions
from armload_identification.recording.row_block import RowBlock
from armload_identification.storage.regular_file import hash_of_files, read_whole

STORAGE_SUFFIXES: Final = (".db3", ".mcap")
METADATA: Final = "metadata.yaml"
_DEEPEST: Final = 50
_ZSTD: Final = b"\x28\xb5\x2f\xfd"
_LARGEST_RATIO: Final = 64
"""Of a file's size when it is unpacked to its size, above `MOST_BYTES`; bags of joint states have less than 10."""
_LONGEST_FIRST_LINE: Final = 64
_STAMP: Final = slice(4, 12)
"""Bytes of the header's time in a message: after the encoding in ROS 2, after a count in ROS 1."""
_BLOCK_ROWS: Final = 2**9
_LEARNT_FROM: Final = 400
"""Messages of each topic from which joints and time stamps are chosen."""
_INCREASING: Final = 0.9
"""Share of the header stamps that must increase for them to be used."""
_TYPES: Final = (
    "sensor_msgs/msg/JointState",
    "control_msgs/msg/DynamicJointState",
    "control_msgs/msg/JointTrajectoryControllerState",
)
_DEFINITIONS: Final = Path(__file__).with_name("ros_messages.msg")
"""The definitions of ROS 2 Humble, whose SQLite bags do not contain those of their messages: the first of the types,
then the others and what they consist of; only those needed, because all take half as long as NumPy to load."""


@dataclass(frozen=True, eq=False)
class _JointSample:
    """One message: names, and numbers in the same order: position, velocity, effort, each empty if it is missing."""

    names: tuple[str, ...]
    stamp_ns: int
    columns: list[FloatArray]


_Quantity = TypeVar("_Quantity")
_Message = tuple[Connection, int, bytes]
"""A message of the library: its connection, the bag's time in ns, and its bytes."""


@dataclass(frozen=True)
class _Choice:
    """Topic, joints and quantities that are read from a bag; whether each of position, velocity and effort is."""

    topic: str
    names: tuple[str, ...]
    used: tuple[bool, ...]
    by_header: bool

    def of(self, quantities: Sequence[_Quantity]) -> list[_Quantity]:
        """The used ones of position, velocity and effort."""
        return list(compress(quantities, self.used))


class RosReader(RecordingReader):
    """Reads the joint states of a ROS 2 bag.

    Args:
        path: The bag's folder, or a storage file.
        options: Quantity of the effort, and the wanted joints.

    Raises:
        RecordingError: not a bag, or one without joint positions.
    """

    kind = "ros2"

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        self._path, self._options = path, options
        self._bag = _bag_of(path)
        with self._opened(checked=False) as reader:
            self._choice = self._chosen(reader)

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`; a message that cannot be read is counted as malformed.

        Raises:
            RecordingError: the bag is damaged.
        """
        account.joint_names = self._choice.names
        account.sha256 = hash_of_files(_files_of(self._bag))
        with self._opened() as reader:
            messages = reader.messages(_of_topic(reader, self._choice.topic))
            while part := list(islice(messages, _BLOCK_ROWS)):
                rows = self._equal_messages(reader, part)
                if rows is None:
                    rows = self._one_by_one(reader, part, account)
                else:
                    account.rows_read += len(rows)
                if len(rows):
                    yield self._block(rows)

    def _one_by_one(self, reader: AnyReader, part: Sequence[_Message], account: ReadingAccount) -> FloatArray:
        """(K, 1 + k n) times and numbers of the messages that have all chosen joints."""
        rows = []
        for when_ns, sample in _samples(reader, part):
            if sample is not None and not set(self._choice.names) <= set(sample.names):
                continue
            account.rows_read += 1
            if sample is None or sample.columns[0].size != len(sample.names):
                account.reasons["malformed message"] += 1
                continue
            order = [sample.names.index(name) for name in self._choice.names]
            row = [(sample.stamp_ns if self._choice.by_header else when_ns) * 1e-9]
            for values in self._choice.of(sample.columns):
                row += values[order].tolist() if _is_measured(values, sample) else [np.nan] * len(order)
            rows.append(row)
        return np.array(rows, dtype=np.float64)

    def _equal_messages(self, reader: AnyReader, part: Sequence[_Message]) -> FloatArray | None:
        """The same, if the messages are joint states that differ in stamps and numbers only; None for others.

        The library takes 10 us for a message. The arrays of a message are its end, each after its length, which CDR
        pads to 8 bytes; whether the numbers are there is tested with the first message.
        """
        connection, _, first = part[0]
        sample = next(_samples(reader, part[:1]))[1]
        if sample is None or connection.msgtype != _TYPES[0] or any(len(raw) != len(first) for *_, raw in part):
            return None
        before, size = (8 if reader.is2 else 4), 8 * len(sample.names)
        ends = [len(first) - later * (size + before) for later in (2, 1, 0)]
        data = np.frombuffer(b"".join(raw for *_, raw in part), np.uint8).reshape(len(part), -1)
        differs = (data != data[0]).any(axis=0)
        differs[_STAMP if reader.is2 else slice(_STAMP.stop)] = False  # ROS 1 counts its messages before the stamp
        for end in ends:
            differs[end - size : end] = False
        if differs.any() or ends[0] - size < _STAMP.stop or not set(self._choice.names) <= set(sample.names):
            return None
        arrays = [data[:, end - size : end].copy().view("<f8") for end in ends]
        if not all(map(partial(np.array_equal, equal_nan=True), (array[0] for array in arrays), sample.columns)):
            return None
        order = [sample.names.index(name) for name in self._choice.names]
        stamps = data[:, _STAMP].copy().view("<u4").astype(np.int64) @ [10**9, 1]
        times = stamps if self._choice.by_header else np.array([when_ns for _, when_ns, _ in part])
        return np.column_stack([times * 1e-9, *(array[:, order] for array in self._choice.of(arrays))])

    def _chosen(self, reader: AnyReader) -> _Choice:
        """Choose topic, joints and time stamps."""
        topics = sorted({connection.topic for connection in reader.connections if connection.msgtype in _TYPES})
        groups: dict[tuple[str, frozenset[str]], list[_JointSample]] = {}
        for topic in topics:
            messages = reader.messages(_of_topic(reader, topic))
            for _, sample in islice(_samples(reader, messages), _LEARNT_FROM + 1):
                if sample is not None and sample.columns[0].size == len(sample.names) > 0:
                    groups.setdefault((topic, frozenset(sample.names)), []).append(sample)
        if not groups:
            others = ", ".join(sorted({connection.msgtype for connection in reader.connections})) or "nothing"
            raise RecordingError(
                f"{self._path}: the bag has no joint positions; it has {others}. "
                f"Record a topic of one of these types: {', '.join(_TYPES)}."
            )
        arm = JointNames(self._options.joint_names)

        def worth(key: tuple[str, frozenset[str]]) -> tuple[int, int, int, int]:
            with_effort = any(_is_measured(sample.columns[2], sample) for sample in groups[key])
            return len(arm.places(sorted(key[1]))), with_effort, len(key[1]), len(groups[key])

        best = max(groups, key=worth)
        samples = groups[best]
        stamps = np.array([sample.stamp_ns for sample in samples], dtype=np.int64)
        wanted = [name for name in self._options.joint_names if name in samples[0].names]
        return _Choice(
            best[0],
            (*wanted, *(name for name in samples[0].names if name not in wanted)),
            used=(True, *(any(_is_measured(sample.columns[k], sample) for sample in samples) for k in (1, 2))),
            by_header=stamps.size > 1 and float(np.mean(np.diff(stamps) > 0)) >= _INCREASING,
        )

    def _block(self, table: FloatArray) -> RowBlock:
        """Rows as a block."""
        effort = "current_a" if self._options.effort is Effort.CURRENT else "torque_nm"
        names = self._choice.of(("position_rad", "velocity_rad_s", effort))
        return RowBlock(table[:, 0], **dict(zip(names, np.hsplit(table[:, 1:], len(names)), strict=True)))

    @contextmanager
    def _opened(self, *, checked: bool = True) -> Iterator[AnyReader]:
        """Open the bag."""
        with _with_plain_files(self._bag) as bag:
            files = _files_of(bag)
            for file in () if checked else files:
                if file.suffix in _REQUIRE_BOUNDED:
                    _REQUIRE_BOUNDED[file.suffix](file)
            defined = any(file.suffix == ".mcap" for file in files)
            with AnyReader([bag], default_typestore=None if defined else _types_of_sqlite_bags()) as reader:
                yield reader


@contextmanager
def _with_plain_files(bag: Path) -> Iterator[Path]:
    """The bag, or a copy whose files are unpacked if they are compressed as a whole."""
    packed = [file for file in _files_of(bag) if bag.is_dir() and _start_of(file, len(_ZSTD)) == _ZSTD]
    if not packed:
        yield bag
        return
    with TemporaryDirectory() as name:
        for file in packed:
            most = max(MOST_BYTES, _LARGEST_RATIO * file.stat().st_size)
            with file.open("rb") as source, Path(name, file.name.removesuffix(".zstd")).open("wb") as target:
                target.writelines(unpacked(source, "zstd", most))
        metadata = read_whole(bag / METADATA).replace(b".zstd", b"")
        Path(name, METADATA).write_bytes(re.sub(rb"(compression_mode:).*", rb"\1 ''", metadata))
        yield Path(name)


def _start_of(file: Path, size: int) -> bytes:
    with file.open("rb") as stream:
        return stream.read(size)


def _require_small_messages(path: Path) -> None:
    """Raise if a message of an SQLite bag, unpacked if it is compressed, takes more memory than a reader may hold."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as bag:
        (largest,) = bag.execute("SELECT max(length(data)) FROM messages").fetchone()
        if largest is not None and largest > MOST_BYTES:
            raise ValueError(f"a message of {largest} bytes, at most {MOST_BYTES} are possible")
        for (data,) in bag.execute("SELECT data FROM messages WHERE substr(data, 1, 4) = ?", (_ZSTD,)):
            require_bounded(BytesIO(data), "zstd")


def _require_small_chunks(path: Path) -> None:
    """Raise if a chunk of a ROS 1 bag takes more memory than a reader may hold."""
    with path.open("rb") as bag:
        bag.readline(_LONGEST_FIRST_LINE)
        while len(size := bag.read(4)) == 4:
            header = bag.read(min(int.from_bytes(size, "little"), MOST_BYTES))
            length = int.from_bytes(bag.read(4), "little")
            compression = re.search(rb"compression=([a-z0-9]+)", header)
            if compression is None:
                bag.seek(length, os.SEEK_CUR)
            elif length > MOST_BYTES:
                raise ValueError(f"a chunk of {length} bytes, at most {MOST_BYTES} are possible")
            else:
                require_bounded(BytesIO(bag.read(length)), compression[1].decode())


_REQUIRE_BOUNDED: Final = {
    ".mcap": require_small_chunks,
    ".db3": _require_small_messages,
    ".bag": _require_small_chunks,
}


@cache
def _types_of_sqlite_bags() -> Typestore:
    """Types for SQLite bags, which may have no definitions; MCAP and ROS 1 do."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(_DEFINITIONS.read_text("utf-8"), _TYPES[0]))
    return store


def _of_topic(reader: AnyReader, topic: str) -> list[Connection]:
    return [one for one in reader.connections if one.topic == topic and one.msgtype in _TYPES]


def _samples(reader: AnyReader, messages: Iterable[_Message]) -> Iterator[tuple[int, _JointSample | None]]:
    """Each message with the bag's time; None for an unreadable message."""
    for connection, when_ns, raw in messages:
        try:
            yield when_ns, _sample(connection, reader.deserialize(raw, connection.msgtype))
        except Exception:  # noqa: BLE001 - damaged messages make the library raise anything
            yield when_ns, None


def _sample(connection: Connection, message: Any) -> _JointSample:
    """Joints of a message of one of the types."""
    names: Sequence[str]
    columns: Sequence[Sequence[float]]
    if connection.msgtype == _TYPES[0]:
        names, columns = message.name, (message.position, message.velocity, message.effort)
    elif connection.msgtype == _TYPES[1]:
        names = message.joint_names
        values = [dict(zip(value.interface_names, value.values, strict=True)) for value in message.interface_values]
        columns = [
            [value[key] for value in values] if all(key in value for value in values) else []
            for key in ("position", "velocity", "effort")
        ]
    else:
        point = message.feedback if hasattr(message, "feedback") else message.actual
        names, columns = message.joint_names, (point.positions, point.velocities, point.effort)
    stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    return _JointSample(tuple(names), stamp_ns, [np.array(column, dtype=np.float64) for column in columns])


def _is_measured(values: FloatArray, sample: _JointSample) -> bool:
    """Whether a message has a quantity for all its joints, not just NaN as a placeholder."""
    return values.size == len(sample.names) and not np.isnan(values).all()


def _bag_of(path: Path) -> Path:
    """The path for the library, a folder with its metadata or a storage file; `RecordingError` if it is no bag."""
    if (path / METADATA).is_file():
        brackets = re.sub(rb"[^][{}]", b"", read_whole(path / METADATA))
        # the library's time for nested lists grows with the square of their depth
        if max(accumulate(1 if sign in b"[{" else -1 for sign in brackets), default=0) > _DEEPEST:
            raise ValueError(f"{METADATA} has lists that are nested more than {_DEEPEST} times")
        return path
    if not path.is_dir():
        return path
    files = sorted(file for file in path.iterdir() if file.suffix in STORAGE_SUFFIXES)
    if len(files) != 1:
        raise RecordingError(
            f"{path}: the folder has no {METADATA} and {len(files)} storage files ({' or '.join(STORAGE_SUFFIXES)}). "
            "Rebuild its index: ros2 bag reindex; or give one of its files."
        )
    return files[0]


def _files_of(bag: Path) -> list[Path]:
    """A storage file, or all files of a folder."""
    return sorted(file for file in bag.iterdir() if file.is_file()) if bag.is_dir() else [bag]
