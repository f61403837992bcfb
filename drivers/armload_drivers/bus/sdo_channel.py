"""Reading and writing objects of one node by SDO, with errors that name node, joint, step and object.

The client is canopen's, but waits by pumping the bus instead of using a receive thread. So there is never more than one
request to a node in progress, and every wait has a limit.
"""

from __future__ import annotations

import logging
import math
import struct
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import can
from canopen import ObjectDictionary
from canopen.sdo import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.cia402.object_dictionary import SDO_RX_BASE, SDO_TX_BASE, Entry
from armload_drivers.driver_errors import SdoRefused, ServoError, ServoTimeout

# canopen logs every abort, which its caller reports; without a handler Python would print it to the operator.
logging.getLogger("canopen").addHandler(logging.NullHandler())

NO_SUBINDEX = 0x0609_0011
"""Abort code for a missing sub-index."""

_MISSING = frozenset({0x0602_0000, NO_SUBINDEX})
"""Abort codes for a missing object or sub-index."""

READ_ONLY = 0x0601_0002
"""Abort code for a read-only object."""

POLL_S = 5e-3
"""Time between two reads of an object that is expected to reach a value."""

_INITIATE = frozenset({1, 2})
"""Client commands whose response repeats index and sub-index: initiate download, initiate upload."""


_UPLOADED = 2
"""Server command with the value of an object, as opposed to an abort."""
_HEAD = struct.Struct("<BHB")
"""Command, index and sub-index of a frame."""


class _NoAnswer(SdoCommunicationError):  # type: ignore[misc]
    """The node did not answer in time."""


class _AnsweredTwice(SdoCommunicationError):  # type: ignore[misc]
    """One request was answered by two nodes."""


class _PumpedSdoClient(SdoClient):  # type: ignore[misc]
    """canopen's client, waiting by pumping the bus."""

    def __init__(self, node_id: int, link: BusLink, timeout_s: float) -> None:
        super().__init__(SDO_RX_BASE + node_id, SDO_TX_BASE + node_id, ObjectDictionary())
        self._link = link
        self._answers: deque[bytes] = deque()
        self._earlier = b""
        self._asked = False
        self._asking = can.Message(arbitration_id=self.rx_cobid, data=bytes(8), is_extended_id=False)
        self.timeout_s = timeout_s
        link.subscribe(self.tx_cobid, lambda data: self._answers.append(bytes(data)))

    def send_request(self, request: bytes) -> None:
        """Send a request, or an abort."""
        self._link.send_frame(self.rx_cobid, bytes(request))

    def write_expedited(self, entry: Entry, data: bytes) -> None:
        """Write up to four bytes in one frame. canopen's own stream repeats a refused write when it is closed."""
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, entry.index, entry.subindex)
        answer = self.request_response(head + data.ljust(4, b"\0"))
        if answer[0] != 0x60:
            raise SdoCommunicationError(f"answered 0x{answer[0]:02X} to a write")

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send a request and wait for its answer; answers to earlier requests are dropped."""
        self._answers.clear()
        earlier, asked = self._earlier, self._asked
        self._earlier, self._asked = b"", False
        self.send_request(sdo_request)
        try:
            answer = self.read_response()
        except _NoAnswer:
            self.abort(0x0504_0000)
            raise
        self._earlier = bytes(sdo_request[1:4])
        if sdo_request[0] >> 5 not in _INITIATE or answer[1:4] == self._earlier:
            return answer
        if answer[1:4] == earlier and asked:
            # The answer to `ask`, which nobody waits for any more.
            return self.read_response()
        what = f"object {answer[2]:02X}{answer[1]:02X}:{answer[3]}"
        if answer[1:4] == earlier:
            raise _AnsweredTwice(f"{what} was answered twice: two drives have node id {self.rx_cobid - SDO_RX_BASE}")
        raise SdoCommunicationError(f"answered for {what}; another SDO client is active")

    def ask(self, entry: Entry) -> None:
        """Request an object without waiting; `take` returns the answer."""
        self._answers.clear()
        message = self._asking
        _HEAD.pack_into(message.data, 0, 0x40, entry.index, entry.subindex)
        self._earlier, self._asked = bytes(message.data[1:4]), True
        self._link.send(message)

    def take(self) -> bytes | None:
        """The answer to `ask`; None if it has not arrived. Answers for other objects are dropped."""
        while self._answers:
            answer = self._answers.popleft()
            if len(answer) == 8 and answer[1:4] == self._earlier and answer[0] >> 5 == _UPLOADED:
                return answer
        return None

    def read_response(self) -> bytes:
        """Pump until an answer is received."""
        if not self._link.pump_until(lambda: bool(self._answers), self.timeout_s):
            raise _NoAnswer(f"no answer within {self.timeout_s} s")
        answer = self._answers.popleft()
        if len(answer) != 8:
            raise SdoCommunicationError(f"answered with {len(answer)} bytes instead of 8")
        if answer[0] == 0x80:
            raise SdoAbortedError(*struct.unpack_from("<I", answer, 4))
        return answer


class SdoChannel:
    """SDO access to one node.

    Args:
        node_id: Node id.
        joint: Name of its joint, for errors.
        link: The bus.
        timeout_s: Limit of one request.

    Attributes:
        step: The step in progress, for errors; set by the user of the channel.
        node: Node id, and name of the joint.
    """

    def __init__(self, node_id: int, joint: str, link: BusLink, timeout_s: float) -> None:
        self.step = "SDO transfer"
        self.node = node_id, joint
        self._node_id, self._joint, self._link = node_id, joint, link
        self._timeout_s = timeout_s
        self._client = _PumpedSdoClient(node_id, link, timeout_s)

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
        try:
            return self.read(entry)
        except SdoRefused as refusal:
            if refusal.abort_code in _MISSING:
                return None
            raise

    def bits_if_there(self, entry: Entry) -> int | None:
        """Size of an object in bits as sent by the node; None if it does not have it. Raises as `read`."""
        try:
            return 8 * len(self._transfer(entry, None))
        except SdoRefused as refusal:
            if refusal.abort_code in _MISSING:
                return None
            raise

    def has(self, entry: Entry) -> bool:
        """Whether the node has an object, even if it cannot be read."""
        try:
            self.read(entry)
        except SdoRefused as refusal:
            return refusal.abort_code not in _MISSING
        return True

    def read_real_if_there(self, entry: Entry) -> float | None:
        """Value of an integer or floating-point object; None if the node does not have it."""
        if not entry.type.is_real:
            return self.read_if_there(entry)
        try:
            data = self._transfer(entry, None)
        except SdoRefused as refusal:
            if refusal.abort_code in _MISSING:
                return None
            raise
        if len(data) != entry.type.bits // 8:
            raise self.failure(f"reading {entry}: {len(data)} bytes are not a REAL32", "See the drive's manual")
        (value,) = struct.unpack("<f", data)
        return float(value)

    def ask(self, entry: Entry) -> None:
        """Request an object of up to four bytes without waiting for the answer."""
        self._client.ask(entry)

    def answer(self, entry: Entry) -> int | None:
        """Value of the integer object that was asked for last; None if no value has arrived."""
        found = self._client.take()
        return None if found is None else self._integer(entry, found[4:])

    def read_text(self, entry: Entry) -> str:
        """Value of a string object; invalid bytes are replaced. Raises as `read`."""
        return self._transfer(entry, None).decode("utf-8", errors="replace").rstrip("\0")

    def read_text_if_there(self, entry: Entry) -> str:
        """As `read_text`, but empty if the node refuses the request."""
        try:
            return self.read_text(entry)
        except SdoRefused:
            return ""

    def write(self, entry: Entry, value: int) -> None:
        """Write an integer object. Raises as `read`."""
        self._transfer(entry, struct.pack("<" + entry.type.code, value))

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
                return True
        return True

    @contextmanager
    def limited_to(self, timeout_s: float) -> Iterator[None]:
        """Another limit of one request within a block."""
        self._client.timeout_s = timeout_s
        try:
            yield
        finally:
            self._client.timeout_s = self._timeout_s

    def read_until(self, entry: Entry, value: int, timeout_s: float) -> int:
        """Read until an object has a value or the time is over; returns the last value. Raises as `read`."""
        found = self.read(entry)
        for _ in range(math.ceil(timeout_s / POLL_S)):
            if found == value:
                break
            self._link.pump_for(POLL_S)
            found = self.read(entry)
        return found

    def failure(self, what: str, remedy: str) -> ServoError:
        """Error of this node at the present step."""
        return ServoError(self._node_id, self._joint, self.step, what, remedy)

    def _transfer(self, entry: Entry, data: bytes | None) -> bytes:
        """Write `data`, or read if it is None."""
        verb = "reading" if data is None else "writing"
        try:
            if data is None:
                return bytes(self._client.upload(entry.index, entry.subindex))
            self._client.write_expedited(entry, data)
        except SdoAbortedError as error:
            text = SdoAbortedError.CODES.get(error.code, "a code that CiA 301 does not list")
            raise SdoRefused(
                self._node_id,
                self._joint,
                self.step,
                f"{verb} {entry} was refused with 0x{error.code:08X}, {text}",
                "The drive does not support this, at least not in its present state; see its manual",
                error.code,
            ) from error
        except _NoAnswer as error:
            raise ServoTimeout(
                self._node_id,
                self._joint,
                self.step,
                f"{verb} {entry}: {error}",
                "Is the drive powered and connected, with this node id and bit rate?",
            ) from error
        except _AnsweredTwice as error:
            raise self.failure(
                f"{verb} {entry}: {error}", "Give each drive a node id of its own, or unplug one"
            ) from error
        except SdoCommunicationError as error:
            raise self.failure(
                f"{verb} {entry}: {error}", "Is another master or configuration tool on the bus?"
            ) from error
        return b""
