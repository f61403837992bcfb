"""The recordings that armload makes: one topic of an MCAP file, in blocks.

A file whose writer was killed ends in the middle of a record: everything before that record is whole and is read.
The library's record classes are used where there are few records; messages, of which there are millions, are cut out
of their chunk here.
"""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import orjson
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream
from zstandard import ZstdError

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.row_block import RowBlock
from armload_identification.recording.run_format import MAGIC, RUN_ATTACHMENT, TOPIC

_BLOCK_ROWS: Final = 2**13
_COPY_BYTES: Final = 2**20
_RECORD: Final = struct.Struct("<BQ")
"""In front of every record: its kind and length."""
_CHANNEL_ID: Final = struct.Struct("<H")
_MESSAGE_HEADER: Final = 22
"""In front of a message's data: channel, sequence number and two times."""
_CHECKSUM_BYTES: Final = 4
_SCALARS: Final = ("time_s", "phase_s")
_OPTIONAL: Final = ("velocity_rad_s", "current_a", "torque_nm")
_UNUSABLE: Final = (KeyError, TypeError, ValueError, AttributeError, struct.error)
"""What a message raises that is not as the schema has it."""
_MISSING: Final = b"feedback missing"
"""In place of a row whose feedback did not arrive."""


class McapReader:
    """Reads the topic `run_format.TOPIC`.

    Args:
        path: The MCAP file; it may be cut short.

    Raises:
        RecordingError: an attachment is damaged.
    """

    kind = "mcap"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.attachments: Mapping[str, str] = dict(self._attached())

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """See `RecordingReader`; a message that is not as `run_format.MESSAGE_SCHEMA` is counted as malformed.

        Raises:
            RecordingError: the file is damaged, or has no message on the topic.
        """
        table = _Table(account)
        for messages in self._messages(account):
            table.add(messages)
            if table.waiting >= _BLOCK_ROWS:
                yield from table.take()
        yield from table.take()
        if not table.width:
            raise RecordingError(
                f"{self._path}: no usable message on {TOPIC}, so nothing was recorded. "
                "Record the run again; the drives must reach operation first."
            )
        account.joint_names = _joint_names(self.attachments.get(RUN_ATTACHMENT, "{}"), table.width)

    def _messages(self, account: ReadingAccount) -> Iterator[list[bytes]]:
        """The topic's messages, a chunk at a time."""
        channels: set[int] = set()
        account.truncated = True
        with self._path.open("rb") as file:
            start = file.read(len(MAGIC))
            digest, checksum = hashlib.sha256(start), zlib.crc32(start)
            for opcode, record in _records(file):
                if opcode == Opcode.CHUNK:
                    yield _cut_out(self._unpacked(record), channels)
                elif opcode in {Opcode.CHANNEL, Opcode.MESSAGE}:
                    yield _cut_out(record, channels)
                elif opcode == Opcode.DATA_END:
                    expected = DataEnd.read(_content(record)).data_section_crc
                    if expected not in {0, checksum}:
                        raise self._damaged("the check sum of its data section is wrong")
                elif opcode == Opcode.FOOTER:
                    account.truncated = False
                digest.update(record)
                checksum = zlib.crc32(record, checksum)
            # Bytes after the last whole record belong to the file all the same.
            while rest := file.read(_COPY_BYTES):
                digest.update(rest)
        account.sha256 = digest.hexdigest()

    def _attached(self) -> Iterator[tuple[str, str]]:
        """Name and text of each attachment; of several with one name the last counts."""
        with self._path.open("rb") as file:
            file.read(len(MAGIC))
            for _, record in _records(file, only=Opcode.ATTACHMENT):
                try:
                    attachment = Attachment.read(_content(record))
                except (McapError, ValueError, struct.error) as error:
                    raise self._damaged(f"an attachment cannot be read: {error}") from error
                checksum = int.from_bytes(record[-_CHECKSUM_BYTES:], "little")
                if checksum not in {0, zlib.crc32(record[_RECORD.size : -_CHECKSUM_BYTES])}:
                    raise self._damaged(f"the check sum of the attachment {attachment.name} is wrong")
                yield attachment.name, attachment.data.decode("utf-8", errors="replace")

    def _unpacked(self, record: bytes) -> bytes:
        """The records of a chunk."""
        try:
            stream, length = get_chunk_data_stream(Chunk.read(_content(record)), validate_crc=True)
            unpacked: bytes = stream.read(length)
        except CRCValidationError as error:
            raise self._damaged(str(error)) from error
        except (McapError, ZstdError, RuntimeError, ValueError, struct.error) as error:
            raise self._damaged(f"a chunk cannot be unpacked: {error}") from error
        return unpacked

    def _damaged(self, how: str) -> RecordingError:
        return RecordingError(f"{self._path}: damaged, {how}. Copy the file again from where it was recorded.")


class _Table:
    """Numbers of messages, row by row: time, phase, and the arrays that the messages hold side by side.

    Which arrays these are is seen from the first and the last message of every chunk; where another message of the
    chunk lacks one, its row holds NaN.
    """

    def __init__(self, account: ReadingAccount) -> None:
        self._account = account
        self._parts: list[tuple[tuple[str, ...], FloatArray]] = []
        self.width = 0
        self.waiting = 0

    def add(self, messages: list[bytes]) -> None:
        """The messages of one chunk."""
        self._account.rows_read += len(messages)
        names = self._names_of(messages)
        if not names:
            self._account.leave_out(len(messages), "malformed message")
            return
        get: Callable[[Any], tuple[Any, ...]] = itemgetter("missing", *_SCALARS, *names)
        width = len(_SCALARS) + self.width * len(names)
        row_of = _packer(width, len(names))
        rows: list[bytes] = []
        for message in messages:
            # This runs once for every cycle of a recording: numbers go into bytes at once, and nothing else is kept.
            try:
                rows.append(row_of(*get(orjson.loads(message))))
            except _UNUSABLE:
                rows += self._unusual(message, names)
        self._account.leave_out(rows.count(_MISSING), "feedback missing")
        rows = [row for row in rows if row is not _MISSING] if _MISSING in rows else rows
        if rows:
            self._parts.append((names, np.frombuffer(b"".join(rows)).reshape(-1, width)))
            self.waiting += len(rows)

    def take(self) -> Iterator[RowBlock]:
        """Everything collected since the last time, as blocks of one layout each."""
        parts, self._parts, self.waiting = self._parts, [], 0
        while parts:
            names = parts[0][0]
            same = next((i for i, (other, _) in enumerate(parts) if other != names), len(parts))
            table = np.concatenate([part for _, part in parts[:same]])
            parts = parts[same:]
            first = len(_SCALARS)
            arrays = {
                name: table[:, first + i * self.width : first + (i + 1) * self.width] for i, name in enumerate(names)
            }
            yield RowBlock(
                time_s=table[:, 0],
                position_rad=arrays["position_rad"],
                velocity_rad_s=arrays.get("velocity_rad_s"),
                current_a=arrays.get("current_a"),
                torque_nm=arrays.get("torque_nm"),
                phase_s=table[:, 1],
            )

    def _names_of(self, messages: list[bytes]) -> tuple[str, ...]:
        """The arrays of a chunk's messages; nothing where none of them can be used."""
        names: set[str] = set()
        for order in (messages, messages[::-1]):
            for message in order:
                try:
                    content = orjson.loads(message)
                    self.width = self.width or len(content["position_rad"])
                    names.update(name for name in _OPTIONAL if content.get(name) is not None)
                except _UNUSABLE:
                    continue
                break
            else:
                return ()
        return ("position_rad", *(name for name in _OPTIONAL if name in names))

    def _unusual(self, message: bytes, names: tuple[str, ...]) -> list[bytes]:
        """The row of a message that lacks an array or holds null; none, and counted, where it is malformed."""
        try:
            content = orjson.loads(message)
            row = [content[key] for key in _SCALARS]
            for name in names:
                numbers = content.get(name)
                row += [np.nan] * self.width if numbers is None else numbers
                if len(row) % self.width != len(_SCALARS) % self.width:
                    raise ValueError(name)
            missing = content.get("missing") or [False] * self.width
            if len(missing) != self.width:
                raise ValueError("missing")
            return [_MISSING if True in missing else np.array(row, dtype=np.float64).tobytes()]
        except _UNUSABLE:
            self._account.leave_out(1, "malformed message")
            return []


def _joint_names(run: str, n: int) -> tuple[str, ...]:
    """The names of n joints in a run's description; none where it does not have them."""
    try:
        names = orjson.loads(run)["joints"]
    except _UNUSABLE:
        return ()
    good = isinstance(names, list) and all(isinstance(name, str) and name for name in names)
    return tuple(names) if good and len(set(names)) == len(names) == n else ()


def _packer(width: int, arrays: int) -> Callable[..., bytes]:
    """From missing feedback, time, phase and that many arrays to the bytes of a row of that width."""
    pack, nan = struct.Struct(f"{width}d").pack, float("nan")

    def two(missing: Any, time_s: Any, phase_s: Any, one: Any, other: Any) -> bytes:
        if True in missing:
            return _MISSING
        return pack(time_s, nan if phase_s is None else phase_s, *one, *other)

    def three(missing: Any, time_s: Any, phase_s: Any, one: Any, other: Any, third: Any) -> bytes:
        if True in missing:
            return _MISSING
        return pack(time_s, nan if phase_s is None else phase_s, *one, *other, *third)

    def many(missing: Any, time_s: Any, phase_s: Any, *parts: Any) -> bytes:
        if True in missing:
            return _MISSING
        return pack(time_s, nan if phase_s is None else phase_s, *chain.from_iterable(parts))

    # Written out for what nearly all recordings hold: unpacking an unknown number of arrays costs 0.5 us a row.
    usual: dict[int, Callable[..., bytes]] = {2: two, 3: three}
    return usual.get(arrays, many)


def _records(file: BinaryIO, only: int | None = None) -> Iterator[tuple[int, bytes]]:
    """Kind and bytes of every whole record to the footer; the others are skipped where only one kind is wanted."""
    size = os.fstat(file.fileno()).st_size
    while len(header := file.read(_RECORD.size)) == _RECORD.size:
        opcode, length = _RECORD.unpack(header)
        if length > size - file.tell():
            file.seek(-_RECORD.size, os.SEEK_CUR)
            return
        if only is None or opcode == only:
            yield opcode, header + file.read(length)
        else:
            file.seek(length, os.SEEK_CUR)
        if opcode == Opcode.FOOTER:
            return


def _cut_out(records: bytes, channels: set[int]) -> list[bytes]:
    """The data of the topic's messages; channels of the topic are noted on the way."""
    messages = []
    at, end = 0, len(records)
    unpack, channel_of = _RECORD.unpack_from, _CHANNEL_ID.unpack_from
    while at + _RECORD.size <= end:
        opcode, length = unpack(records, at)
        start = at + _RECORD.size
        at = start + length
        if opcode == Opcode.MESSAGE:
            if channel_of(records, start)[0] in channels:
                messages.append(records[start + _MESSAGE_HEADER : at])
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(records[start:at])))
            if channel.topic == TOPIC:
                channels.add(channel.id)
    return messages


def _content(record: bytes) -> ReadDataStream:
    """A record without its header, as the library's classes read it."""
    return ReadDataStream(BytesIO(record[_RECORD.size :]))
