"""Reading and writing objects of one drive, with errors that name node, joint, step and object.

`canopen.canopen_sdo` and `ethercat.coe_sdo` carry the requests.
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.driver_errors import SdoRefused, ServoError, ServoTimeout

NO_SUBINDEX = 0x0609_0011
"""Abort code for a missing sub-index."""

_MISSING = frozenset({0x0602_0000, NO_SUBINDEX})
"""Abort codes for a missing object or sub-index."""

READ_ONLY = 0x0601_0002
"""Abort code for a read-only object."""
OUT_OF_RANGE = frozenset({0x0604_0043, 0x0609_0030, 0x0609_0031, 0x0609_0032})
"""Abort codes for a value that the object does not take."""
_WRITE_ONLY = 0x0601_0001
_LENGTHS = frozenset({0x0607_0010, 0x0607_0012, 0x0607_0013})
"""Abort codes for a value of another size than that of the object."""
_LARGEST_NUMBER = 4
"""Bytes of the largest integer that is written."""

POLL_S = 5e-3
"""Time between two reads of an object that is expected to reach a value."""


class SdoChannel(ABC):
    """SDO access to one drive.

    Args:
        joint: Name of its joint, for errors.
        timeout_s: Limit of one request.

    Attributes:
        step: The step in progress, for errors; set by the user of the channel.
        node: Node id, and name of the joint.
    """

    def __init__(self, node_id: int, joint: str, timeout_s: float) -> None:
        self.step = "SDO transfer"
        self.node = node_id, joint
        self._limit_s = timeout_s

    def read(self, entry: Entry) -> int:
        """Value of an integer object.

        Raises:
            SdoRefused: the node answers with an abort code.
            ServoTimeout: the node does not answer.
            ServoError: the answer is invalid.
        """
        return self._integer(entry, self._transfer(entry, None))

    @staticmethod
    def _integer(entry: Entry, data: bytes) -> int:
        """Value of an integer object."""
        return int.from_bytes(data[: max(1, entry.type.bits // 8)], "little", signed=entry.type.code.islower())

    def read_if_there(self, entry: Entry) -> int | None:
        """As `read`, but None if the node does not have the object."""
        data = self._data_if_there(entry)
        return None if data is None else self._integer(entry, data)

    def _data_if_there(self, entry: Entry) -> bytes | None:
        """Content of an object; None if the node does not have it."""
        try:
            return self._transfer(entry, None)
        except SdoRefused as refusal:
            if refusal.abort_code in _MISSING:
                return None
            raise

    def bits_if_there(self, entry: Entry) -> int | None:
        """Size of an object in bits as sent by the node; None if it does not have it. Raises as `read`."""
        try:
            data = self._data_if_there(entry)
        except SdoRefused as refusal:
            if refusal.abort_code == _WRITE_ONLY:
                return entry.type.bits
            raise
        return None if data is None else 8 * len(data)

    def has(self, entry: Entry) -> bool:
        """Whether the node has an object, even if it cannot be read."""
        try:
            return self._data_if_there(entry) is not None
        except SdoRefused:
            return True

    def read_real_if_there(self, entry: Entry) -> float | None:
        """Value of an integer or floating-point object; None if the node does not have it."""
        if not entry.type.is_real:
            return self.read_if_there(entry)
        data = self._data_if_there(entry)
        if data is None:
            return None
        if len(data) != entry.type.bits // 8:
            raise self.failure(f"reading {entry}: {len(data)} bytes are not a REAL32", "See the drive's manual")
        (value,) = struct.unpack("<f", data)
        return float(value)

    @abstractmethod
    def ask(self, entry: Entry) -> None:
        """Request an object of up to four bytes without waiting for the answer."""

    def answer(self, entry: Entry) -> int | None:
        """Value of the integer object that was asked for last; None if no value has arrived."""
        found = self._take()
        return None if found is None else self._integer(entry, found)

    def read_text_if_there(self, entry: Entry) -> str:
        """Value of a string object, invalid bytes replaced; empty if the node refuses the request. Raises as `read`."""
        try:
            return self._transfer(entry, None).decode("utf-8", errors="replace").rstrip("\0")
        except SdoRefused:
            return ""

    def write(self, entry: Entry, value: int) -> None:
        """Write an integer object, in the node's size if it is not the standard's. Raises as `read`."""
        try:
            self._transfer(entry, struct.pack("<" + entry.type.code, value))
        except SdoRefused as refusal:
            size = 0
            if refusal.abort_code in _LENGTHS:
                with suppress(SdoRefused):  # an object that cannot be read does not state its size
                    size = len(self._transfer(entry, None))
            if not 0 < size <= _LARGEST_NUMBER or not -(1 << 8 * size - 1) <= value < 1 << 8 * size:
                raise
            self._transfer(entry, (value & (1 << 8 * size) - 1).to_bytes(size, "little"))

    def write_if_there(self, entry: Entry, value: int) -> bool:
        """As `write`, but False if the node does not have the object or it is read-only."""
        try:
            self.write(entry, value)
        except SdoRefused as refusal:
            if refusal.abort_code in _MISSING or refusal.abort_code == READ_ONLY:
                return False
            raise
        return True

    def answers(self, entry: Entry, timeout_s: float) -> bool:
        """Whether the node answers a read within the given time, even with an abort code."""
        with self.limited_to(timeout_s):
            try:
                self.read(entry)
            except ServoTimeout:
                return False
            except SdoRefused:
                pass
        return True

    @contextmanager
    def limited_to(self, timeout_s: float) -> Iterator[None]:
        """Another limit of one request within a block."""
        usual_s, self._limit_s = self._limit_s, timeout_s
        try:
            yield
        finally:
            self._limit_s = usual_s

    def read_until(self, entry: Entry, value: int, timeout_s: float) -> int:
        """Read until an object has a value or the time is over; returns the last value. Raises as `read`."""
        found = self.read(entry)
        for _ in range(math.ceil(timeout_s / POLL_S)):
            if found == value:
                break
            self._wait(POLL_S)
            found = self.read(entry)
        return found

    def failure(self, what: str, remedy: str, kind: type[ServoError] = ServoError) -> ServoError:
        """Error of this node at the present step."""
        return kind(*self.node, self.step, what, remedy)

    def _refused(self, verb: str, entry: Entry, code: int, text: str) -> SdoRefused:
        """Error for a transfer that the node answered with an abort code."""
        if code in _MISSING:
            remedy = f"The drive has no {entry.index:04X}:{entry.subindex}: use firmware that has it, or another drive"
        else:
            remedy = "The drive does not support this, at least not in its present state; see its manual"
        return SdoRefused(*self.node, self.step, f"{verb} {entry} was refused with 0x{code:08X}, {text}", remedy, code)

    @abstractmethod
    def _transfer(self, entry: Entry, data: bytes | None) -> bytes:
        """Write `data`, or read if it is None."""

    @abstractmethod
    def _take(self) -> bytes | None:
        """The answer to `ask`; None if no value has arrived."""

    @abstractmethod
    def _wait(self, time_s: float) -> None:
        """Let this time pass."""
