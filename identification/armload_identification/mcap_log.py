"""The numbers of one MCAP topic, read in bulk.

MCAP is a sequence of records `opcode (1 byte), length (8 bytes), content`; messages sit in chunks. A file
whose writer was killed ends in the middle of a record: everything before that record is whole and is read.

A commissioning log has hundreds of thousands of messages; `json_numbers` reads a chunk of them at once.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from armload_identification.errors import RecordingError
from armload_identification.json_numbers import key_table, parse_messages

FloatArray = NDArray[np.float64]

MAGIC: Final = b"\x89MCAP0\r\n"
_RECORD_HEADER = struct.Struct("<BQ")
_CHUNK_FIXED = struct.Struct("<QQQII")
_MESSAGE_HEADER_BYTES = 22


@dataclass(frozen=True)
class McapContent:
    """What one topic of a file holds.

    Attributes:
        values: Per key (N,) for scalars or (N, width) for arrays; NaN where a message does not carry it.
        attachments: Text of each attachment by name; of several with one name the last counts.
        messages_malformed: Messages that were not the JSON asked for; they have no row.
        truncated: The file ends in the middle of a record or without its footer.
    """

    values: dict[str, FloatArray]
    attachments: dict[str, str]
    messages_malformed: int
    truncated: bool


@dataclass
class _Scan:
    """What has been collected while walking through a file."""

    attachments: dict[str, str] = field(default_factory=dict)
    channel_ids: set[int] = field(default_factory=set)
    footer_seen: bool = False
    cut: bool = False


def _record_pieces(data: memoryview, topic: str, scan: _Scan) -> Iterator[bytes]:
    """Pieces of the file that hold whole message records; attachments and channels go into `scan`."""
    position = len(MAGIC)
    while position < len(data):
        if position + _RECORD_HEADER.size > len(data):
            scan.cut = not scan.footer_seen
            return
        opcode, length = _RECORD_HEADER.unpack_from(data, position)
        start = position + _RECORD_HEADER.size
        end = start + length
        if scan.footer_seen:
            return
        if end > len(data):
            scan.cut = True
            if opcode == Opcode.CHUNK:
                yield _uncompressed_rest(data[start:])
            return
        content = data[start:end]
        if opcode == Opcode.CHUNK:
            piece = _chunk_bytes(content)
            _note_channels(piece, topic, scan)
            yield piece
        elif opcode == Opcode.MESSAGE:
            yield bytes(data[position:end])
        elif opcode == Opcode.CHANNEL:
            _note_channel(bytes(content), topic, scan)
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(ReadDataStream(BytesIO(bytes(content))))
            scan.attachments[attachment.name] = attachment.data.decode("utf-8", errors="replace")
        elif opcode == Opcode.FOOTER:
            scan.footer_seen = True
        position = end
    scan.cut = scan.cut or not scan.footer_seen


def _chunk_bytes(content: memoryview) -> bytes:
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    if not chunk.compression:
        return bytes(chunk.data)
    stream, length = get_chunk_data_stream(chunk)
    return bytes(stream.read(length))


def _uncompressed_rest(content: memoryview) -> bytes:
    """The messages of a chunk that was being written when its writer died; nothing if it is compressed."""
    if len(content) < _CHUNK_FIXED.size:
        return b""
    compression_length = _CHUNK_FIXED.unpack_from(content, 0)[4]
    if compression_length:
        return b""
    return bytes(content[_CHUNK_FIXED.size + 8 :])


def _note_channel(content: bytes, topic: str, scan: _Scan) -> None:
    channel = Channel.read(ReadDataStream(BytesIO(content)))
    if channel.topic == topic:
        scan.channel_ids.add(channel.id)


def _note_channels(piece: bytes, topic: str, scan: _Scan) -> None:
    """Channels that stand at the head of a chunk, before its first message."""
    position = 0
    while position + _RECORD_HEADER.size <= len(piece):
        opcode, length = _RECORD_HEADER.unpack_from(piece, position)
        start = position + _RECORD_HEADER.size
        if opcode == Opcode.MESSAGE:
            return
        if opcode == Opcode.CHANNEL:
            _note_channel(piece[start : start + length], topic, scan)
        position = start + length


def _first_width(piece: bytes, topic: str, key: str, scan: _Scan, path: Path) -> int | None:
    """Length of the array `key` in the first message of the topic; None where the piece holds no message."""
    position = 0
    while position + _RECORD_HEADER.size <= len(piece):
        opcode, length = _RECORD_HEADER.unpack_from(piece, position)
        start = position + _RECORD_HEADER.size
        if (
            opcode == Opcode.MESSAGE
            and int.from_bytes(piece[start : start + 2], "little") in scan.channel_ids
        ):
            try:
                return len(json.loads(piece[start + _MESSAGE_HEADER_BYTES : start + length])[key])
            except (ValueError, KeyError, TypeError) as error:
                raise RecordingError(
                    f"{path}: the first message on {topic} has no list '{key}'. "
                    "The file is not a recording of this program, or is damaged."
                ) from error
        position = start + length
    return None


def read_topic(
    path: Path, data: bytes, topic: str, scalars: Sequence[str], arrays: Sequence[str]
) -> McapContent:
    """Read the numbers of one JSON topic.

    Args:
        path: The MCAP file, for messages.
        data: Its content.
        topic: Name of the channel.
        scalars: Keys that hold one number, null or boolean.
        arrays: Keys that hold lists of them, all as long as the first is in the first message.

    Returns:
        One row per well-formed message, in the order of the file.

    Raises:
        RecordingError: the file is no MCAP file, or has no message on this topic.
    """
    if not data.startswith(MAGIC):
        raise RecordingError(
            f"{path}: not an MCAP file, it does not begin with the format's magic bytes. "
            "Give a recording made by armload, or a CSV file with a column map."
        )
    keys = [*scalars, *arrays]
    scan = _Scan()
    width: int | None = None
    table = np.empty((0, 3), dtype=np.int64)
    tables: list[FloatArray] = []
    malformed = 0
    for piece in _record_pieces(memoryview(data), topic, scan):
        if width is None:
            width = _first_width(piece, topic, arrays[0], scan, path)
            if width is None:
                continue
            table = key_table(keys, [1] * len(scalars) + [width] * len(arrays))
        # Every message holds an opening brace, so this is room enough.
        numbers = np.empty((piece.count(b"{"), len(scalars) + width * len(arrays)))
        channels = np.array(sorted(scan.channel_ids), dtype=np.int64)
        rows, bad = parse_messages(np.frombuffer(piece, dtype=np.uint8), channels, table, numbers)
        malformed += bad
        tables.append(numbers[:rows])
    if width is None:
        raise RecordingError(
            f"{path}: no message on {topic}, so nothing was recorded. "
            "Record the run again; the drives have to reach operation first."
        )
    values = np.concatenate(tables)
    return McapContent(
        values={
            key: values[:, start] if key in scalars else values[:, start : start + size]
            for key, (_, start, size) in zip(keys, table.tolist(), strict=True)
        },
        attachments=scan.attachments,
        messages_malformed=malformed,
        truncated=scan.cut,
    )
