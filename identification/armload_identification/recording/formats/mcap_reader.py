"""Recordings made by armload: one topic of an MCAP file, in blocks.

A file whose writer was killed ends in the middle of a record: everything before that record is complete and is read.

The library's record classes are used for rare records; the millions of messages are read by the kernels. A damaged file
cannot cause excessive use of memory: the size of a record or chunk is bounded.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import orjson
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd

from armload_core import kernels
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.formats.unpacking import require_bounded, unpacked
from armload_identification.recording.read_boundary import MOST_BYTES
from armload_identification.recording.reader import ReadingAccount, RecordingReader
from armload_identification.recording.row_block import BLOCK_ROWS, RowBlock
from armload_identification.recording.run_format import MAGIC, RUN_ATTACHMENT, TOPIC
from armload_identification.storage.regular_file import hash_of_files

_BLOCK_NUMBERS: Final = 2**20
"""Most numbers in a block, for any number of joints."""
_MOST_BYTES: Final = 2**26
"""Most bytes of a record, and of an uncompressed chunk: the recorder's have 1 MB at most."""
_COPY_BYTES: Final = 2**16
_RECORD: Final = struct.Struct("<BQ")
"""Header of every record: its kind and length."""
_CHANNEL_ID: Final = struct.Struct("<H")
_MESSAGE_HEADER: Final = 22
"""Bytes before a message's data: channel, sequence number and two times."""
_CHECKSUM_BYTES: Final = 4
_TOPICS_NAMED: Final = 10
_SCALARS: Final = ("time_s", "phase_s")
_OPTIONAL: Final = ("velocity_rad_s", "current_a", "torque_nm")
"""In the order of the kernels' numbering."""
_SCHEMA_ERRORS: Final = (KeyError, TypeError, ValueError, AttributeError)
"""Exceptions of a message that does not follow the schema."""


class McapReader(RecordingReader):
    """Reads the topic `run_format.TOPIC`.

    Args:
        path: The MCAP file; it may be truncated.

    Raises:
        RecordingError: an attachment is damaged.
    """

    kind = "mcap"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.attachments: Mapping[str, str] = dict(_attached(path))

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`; a message that violates `run_format.MESSAGE_SCHEMA` is counted as malformed.

        Raises:
            RecordingError: the file is damaged, or has no usable message on the topic.
        """
        table = _MessageTable(account)
        for records in self._chunks_of_records(account):
            yield from table.add(records)
        yield from table.take()
        if not table.n:
            others = f"; it has {', '.join(sorted(table.other_topics))}" if table.other_topics else ""
            raise RecordingError(
                f"{self._path}: no usable message on {TOPIC}, so nothing was recorded{others}. "
                "Record the run again; the drives must be enabled first."
            )
        account.joint_names = _joint_names(self.attachments.get(RUN_ATTACHMENT, "{}"), table.n)

    def _chunks_of_records(self, account: ReadingAccount) -> Iterator[bytes]:
        """The file's channels and messages, a chunk at a time."""
        account.sha256, account.truncated = hash_of_files([self._path]), True
        with self._path.open("rb") as file:
            wanted = {Opcode.CHUNK, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.DATA_END, Opcode.FOOTER}
            for opcode, content in _records(file, wanted):
                if opcode == Opcode.CHUNK:
                    yield _unpacked(content)
                elif opcode == Opcode.DATA_END:
                    self._require_checksum(DataEnd.read(_stream(content)), file.tell() - _RECORD.size - len(content))
                elif opcode == Opcode.FOOTER:
                    account.truncated = file.read(len(MAGIC)) != MAGIC
                else:
                    yield _RECORD.pack(opcode, len(content)) + content

    def _require_checksum(self, stated: DataEnd, size: int) -> None:
        """Raise if the first bytes of the file, up to the end of its data section, do not have the stated checksum."""
        checksum = 0
        with self._path.open("rb") as file:
            for start in range(0, size if stated.data_section_crc else 0, _COPY_BYTES):
                checksum = zlib.crc32(file.read(min(_COPY_BYTES, size - start)), checksum)
        if checksum != stated.data_section_crc:
            raise ValueError("the checksum of its data section is wrong")


class _MessageTable:
    """Rows of numbers from the topic's messages: time, phase, and the arrays of the messages.

    The arrays are determined from the first and the last message of the first usable chunk; if another message lacks
    one, its row contains NaN. The kernels read messages as the recorder writes them; all others are read here.
    """

    def __init__(self, account: ReadingAccount) -> None:
        self._account = account
        self._channels: dict[int, bytes] = {}
        self._names: tuple[str, ...] = ()
        self._table = np.empty((0, 0))
        self._filled = 0
        self.n = 0
        self.other_topics: set[str] = set()

    def add(self, records: bytes) -> Iterator[RowBlock]:
        """Full blocks, after the records of one chunk; `ValueError` if one is longer than the chunk."""
        if not self.n:
            self._learn(records)
        at = 0
        while at < len(records):
            if self.n:
                at = self._scan(records, at)
                if self._filled == len(self._table):
                    yield from self.take()
                    continue
            if at < len(records):
                at = self._read_one(records, at)

    def take(self) -> Iterator[RowBlock]:
        """The rows collected since the last call, unless there are none."""
        if not self._filled:
            return
        table = self._table[: self._filled]
        self._table, self._filled = np.empty_like(self._table), 0
        first = len(_SCALARS)
        arrays = {name: table[:, first + i * self.n : first + (i + 1) * self.n] for i, name in enumerate(self._names)}
        yield RowBlock(table[:, 0], **arrays, phase_s=table[:, 1])

    def _learn(self, records: bytes) -> None:
        """Determine joints and arrays from a chunk's messages, unless none of these can be used."""
        messages = []
        at = 0
        while at < len(records):
            message, at = self._record(records, at)
            if message is not None:
                messages.append(message)
        names: set[str] = set()
        for order in (messages, messages[::-1]):
            for message in order:
                try:
                    content = orjson.loads(message)
                    self.n = self.n or len(content["position_rad"])
                    names.update(name for name in _OPTIONAL if content.get(name) is not None)
                except _SCHEMA_ERRORS:
                    continue
                break
        if self.n > kernels.MOST_JOINTS_OF_A_MESSAGE:
            raise ValueError(f"its messages have {self.n} joints")
        self._names = ("position_rad", *(name for name in _OPTIONAL if name in names))
        width = len(_SCALARS) + len(self._names) * self.n
        self._table = np.empty((min(BLOCK_ROWS, _BLOCK_NUMBERS // width), width))

    def _scan(self, records: bytes, at: int) -> int:
        """Read messages with the kernels, up to the first that they cannot read."""
        arrays = sum(1 << bit for bit, name in enumerate(_OPTIONAL) if name in self._names)
        channels = b"".join(self._channels.values())
        room = self._table[self._filled :]
        rows, missing, at = kernels.joint_rows_into(records, at, channels, arrays, self.n, room)
        self._filled += rows
        self._account.rows_read += rows + missing
        self._account.reasons += Counter({"feedback missing": missing})
        return at

    def _read_one(self, records: bytes, at: int) -> int:
        """Read the next record, of any kind."""
        message, at = self._record(records, at)
        if message is None:
            return at
        self._account.rows_read += 1
        try:
            row = self._row(message)
        except _SCHEMA_ERRORS:
            self._account.reasons["malformed message"] += 1
            return at
        if row is None:
            self._account.reasons["feedback missing"] += 1
        else:
            self._table[self._filled] = row
            self._filled += 1
        return at

    def _row(self, message: bytes) -> FloatArray | None:
        """Numbers of a message; None if its feedback is missing."""
        if not self.n:
            raise ValueError("no earlier message has positions")
        content = orjson.loads(message)
        row: list[float | None] = [content[key] for key in _SCALARS]
        for name in self._names:
            numbers = content.get(name)
            row += [np.nan] * self.n if numbers is None else numbers
            if len(row) % self.n != len(_SCALARS) % self.n:
                raise ValueError(name)
        missing = content.get("missing") or [False] * self.n
        if len(missing) != self.n or len(row) != self._table.shape[1]:
            raise ValueError("missing")
        return None if True in missing else np.array(row, dtype=np.float64)

    def _record(self, records: bytes, at: int) -> tuple[bytes | None, int]:
        """The next record's message if it is one of the topic, and the start of the record after it."""
        start = at + _RECORD.size
        if start > len(records):
            raise ValueError("a chunk ends in the middle of a record")
        opcode, length = _RECORD.unpack_from(records, at)
        end = start + length
        if end > len(records):
            raise ValueError("a record is longer than its chunk")
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(records[start:end])))
            if channel.topic == TOPIC:
                self._channels[channel.id] = _CHANNEL_ID.pack(channel.id)
            elif len(self.other_topics) < _TOPICS_NAMED:
                self.other_topics.add(channel.topic)
        elif opcode == Opcode.MESSAGE and _CHANNEL_ID.unpack_from(records, start)[0] in self._channels:
            return records[start + _MESSAGE_HEADER : end], end
        return None, end


def require_small_chunks(path: Path) -> None:
    """Raise if a record or a chunk of any program's MCAP file would take more memory than a reader may hold.

    Raises:
        ValueError: naming the size.
    """
    with path.open("rb") as file:
        for _, content in _records(file, {Opcode.CHUNK}, MOST_BYTES):
            chunk = Chunk.read(_stream(content))
            require_bounded(BytesIO(chunk.data), chunk.compression)


def _joint_names(run: str, n: int) -> tuple[str, ...]:
    """The names of n joints in a run's description; empty if it has none."""
    try:
        names = orjson.loads(run)["joints"]
    except _SCHEMA_ERRORS:
        return ()
    good = isinstance(names, list) and all(isinstance(name, str) and name for name in names)
    return tuple(names) if good and len(set(names)) == len(names) == n else ()


def _attached(path: Path) -> Iterator[tuple[str, str]]:
    """Name and text of each attachment."""
    with path.open("rb") as file:
        for _, content in _records(file, {Opcode.ATTACHMENT}):
            attachment = Attachment.read(_stream(content))
            checksum = int.from_bytes(content[-_CHECKSUM_BYTES:], "little")
            if checksum not in {0, zlib.crc32(content[:-_CHECKSUM_BYTES])}:
                raise ValueError(f"the checksum of {attachment.name} is wrong")
            yield attachment.name, attachment.data.decode("utf-8", errors="replace")


def _records(file: BinaryIO, wanted: Collection[int], most: int = _MOST_BYTES) -> Iterator[tuple[int, bytes]]:
    """Kind and content of every complete wanted record up to the footer; `ValueError` for one above `most` bytes."""
    size = os.fstat(file.fileno()).st_size
    file.seek(len(MAGIC))
    while len(header := file.read(_RECORD.size)) == _RECORD.size:
        opcode, length = _RECORD.unpack(header)
        if length > size - file.tell():
            return
        bound = most if opcode in wanted else MOST_BYTES
        if length > bound:
            raise ValueError(f"a record of {length} bytes, at most {bound} are possible")
        if opcode in wanted:
            yield opcode, file.read(length)
        else:
            file.seek(length, os.SEEK_CUR)
        if opcode == Opcode.FOOTER:
            return


def _unpacked(content: bytes) -> bytes:
    """The records of a chunk."""
    chunk = Chunk.read(_stream(content))
    size = chunk.uncompressed_size
    if size > _MOST_BYTES:
        raise ValueError(f"a chunk of {size} bytes, at most {_MOST_BYTES} are possible")
    records = b"".join(unpacked(BytesIO(chunk.data), chunk.compression, size))
    if len(records) != size:
        raise ValueError("a chunk does not have its stated size")
    if chunk.uncompressed_crc not in {0, zlib.crc32(records)}:
        raise ValueError("the checksum of a chunk is wrong")
    return records


def _stream(content: bytes) -> ReadDataStream:
    """A record as a stream for the library's classes."""
    return ReadDataStream(BytesIO(content))
