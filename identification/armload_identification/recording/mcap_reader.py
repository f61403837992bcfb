"""The numbers of one MCAP topic.

A file whose writer was killed ends in the middle of a record: everything before that record is whole and is
read. Messages are turned into arrays a batch at a time, so that half a million of them stay small.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Footer, Message
from mcap.stream_reader import CRCValidationError, StreamReader

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError

MAGIC: Final = b"\x89MCAP0\r\n"
_BATCH: Final = 4096


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


def read_topic(path: Path, data: bytes, topic: str, scalars: Sequence[str], arrays: Sequence[str]) -> McapContent:
    """Read the numbers of one JSON topic.

    Args:
        path: The MCAP file, for messages.
        data: Its content.
        topic: Name of the channel.
        scalars: Keys that hold one number or null.
        arrays: Keys that hold lists of numbers or booleans, all as long as the first is in the first message.

    Returns:
        One row per well-formed message, in the order of the file.

    Raises:
        RecordingError: the file is no MCAP file, is damaged, or has no message on this topic.
    """
    if not data.startswith(MAGIC):
        raise RecordingError(
            f"{path}: not an MCAP file, it does not begin with the format's magic bytes. "
            "Give a recording made by armload, or a CSV file with a column map."
        )
    channels: set[int] = set()
    attachments: dict[str, str] = {}
    table = _Table(path, topic, scalars, arrays)
    complete = False
    try:
        for record in StreamReader(BytesIO(data), validate_crcs=True).records:
            if isinstance(record, Message):
                if record.channel_id in channels:
                    table.add(record.data)
            elif isinstance(record, Channel) and record.topic == topic:
                channels.add(record.id)
            elif isinstance(record, Attachment):
                attachments[record.name] = record.data.decode("utf-8", errors="replace")
            complete = isinstance(record, Footer)
    except CRCValidationError as error:
        raise RecordingError(f"{path}: damaged, {error}. Copy the file again from where it was recorded.") from error
    except (McapError, EOFError, struct.error):
        # The library unpacks whatever is left, so a cut inside a number shows as struct's own error.
        complete = False
    return McapContent(table.values(), attachments, table.malformed, truncated=not complete)


class _Table:
    """Rows of numbers, collected from messages."""

    def __init__(self, path: Path, topic: str, scalars: Sequence[str], arrays: Sequence[str]) -> None:
        self._path, self._topic = path, topic
        self._scalars, self._arrays = scalars, arrays
        self._width = 0
        self._rows: list[list[float]] = []
        self._done: list[FloatArray] = []
        self.malformed = 0

    def add(self, message: bytes) -> None:
        """One message; counted as malformed where it is not as asked for."""
        try:
            content = orjson.loads(message)
            if not self._width:
                self._width = len(content[self._arrays[0]])
            self._rows.append(self._row(content))
        except (ValueError, KeyError, TypeError):
            self.malformed += 1
        if len(self._rows) == _BATCH:
            self._flush()

    def values(self) -> dict[str, FloatArray]:
        """Everything collected, by key.

        Raises:
            RecordingError: nothing was.
        """
        self._flush()
        if not self._done:
            raise RecordingError(
                f"{self._path}: no usable message on {self._topic}, so nothing was recorded. "
                "Record the run again; the drives have to reach operation first."
            )
        table = np.concatenate(self._done)
        values = {key: table[:, i] for i, key in enumerate(self._scalars)}
        for i, key in enumerate(self._arrays):
            first = len(self._scalars) + i * self._width
            values[key] = table[:, first : first + self._width]
        return values

    def _row(self, content: dict[str, Any]) -> list[float]:
        """The wanted numbers of one message side by side."""
        row: list[float] = [content[key] for key in self._scalars]
        for key in self._arrays:
            numbers = content.get(key)
            if numbers is None:
                row += [np.nan] * self._width
            elif len(numbers) == self._width:
                row += numbers
            else:
                raise ValueError(key)
        return row

    def _flush(self) -> None:
        if self._rows:
            self._done.append(np.array(self._rows, dtype=np.float64))
            self._rows = []
