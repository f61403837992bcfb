"""SDO over CAN.

Waits pump the bus. So there is never more than one request to a node in progress, and every wait has a limit.

References:
    CiA 301, 7.2.4.3: expedited transfers, uploads in segments, aborts.
"""

from __future__ import annotations

import struct
from collections import deque
from importlib.resources import files

import can

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import SDO_RX_BASE, SDO_TX_BASE, Entry
from armload_drivers.driver_errors import ServoError, ServoTimeout

_HEAD = struct.Struct("<BHB4s")
"""Command, index, sub-index and data of a frame."""
_TO_READ, _TO_WRITE, _NEXT_SEGMENT, _ABORT = 0x40, 0x23, 0x60, 0x80
"""Commands: initiate upload; expedited download of four bytes; upload of a segment; either side's abort."""
_UPLOADED, _DOWNLOADED = 2, 3
"""Upper three bits of the answers to the first two."""
_EXPEDITED, _SIZED, _LAST, _TOGGLE = 0x02, 0x01, 0x01, 0x10
"""Bits of an answer: it has the whole value; and states its size; it is the last segment; alternates from segment to
segment."""
_SEGMENTS_MOST = 1000
"""Segments of seven bytes of the longest object that is read."""
_TIMED_OUT = struct.pack("<I", 0x0504_0000)
"""Abort code of a client that no longer waits."""

_TABLE = files("armload_configs").joinpath("sdo_abort_codes.txt").read_text("ascii")
_ABORT_CODES = {int(code, 16): meaning for code, _, meaning in (line.partition(" ") for line in _TABLE.splitlines())}
"""Meanings of abort codes (CiA 301, 7.2.4.3.17)."""


class CanopenSdo(SdoChannel):
    """SDO access to one node.

    Args:
        joint: Name of its joint, for errors.
        timeout_s: Limit of one request.
    """

    def __init__(self, node_id: int, joint: str, link: BusLink, timeout_s: float) -> None:
        super().__init__(node_id, joint, timeout_s)
        self._link = link
        self._answers: deque[bytes] = deque()
        self._earlier, self._asked = b"", False
        self._doing = "reading", od.DEVICE_TYPE
        self._message = can.Message(arbitration_id=SDO_RX_BASE + node_id, data=bytes(8), is_extended_id=False)
        link.subscribe(SDO_TX_BASE + node_id, lambda data: self._answers.append(bytes(data)))

    def ask(self, entry: Entry) -> None:
        """Request an object of up to four bytes without waiting for the answer."""
        self._send(_TO_READ, entry.index, entry.subindex)
        self._earlier, self._asked = bytes(self._message.data[1:4]), True

    def _take(self) -> bytes | None:
        """The answer to `ask`; None if no value has arrived. Answers for other objects are dropped."""
        while self._answers:
            answer = self._answers.popleft()
            if len(answer) == 8 and answer[1:4] == self._earlier and answer[0] >> 5 == _UPLOADED:
                return answer[4:]
        return None

    def _wait(self, time_s: float) -> None:
        """Pump the bus for this time."""
        self._link.pump_for(time_s)

    def _transfer(self, entry: Entry, data: bytes | None) -> bytes:
        """Write `data` of up to four bytes in one frame, or read if it is None."""
        if data is None:
            self._doing = "reading", entry
            return self._upload(entry)
        self._doing = "writing", entry
        answer = self._initiate(_TO_WRITE | (4 - len(data)) << 2, entry, data)
        if answer[0] >> 5 != _DOWNLOADED:
            raise self._failed(f"answered 0x{answer[0]:02X} to a write")
        return b""

    def _upload(self, entry: Entry) -> bytes:
        """Read an object; one of more than four bytes comes in segments."""
        answer = self._initiate(_TO_READ, entry)
        if answer[0] >> 5 != _UPLOADED:
            raise self._failed(f"answered 0x{answer[0]:02X} to a read")
        if answer[0] & _EXPEDITED:
            return answer[4 : 8 - (answer[0] >> 2 & 3 if answer[0] & _SIZED else 0)]
        content, toggle = b"", 0
        for _ in range(_SEGMENTS_MOST):
            answer = self._request(_NEXT_SEGMENT | toggle, 0, 0)
            if answer[0] & 0xF0 != toggle:
                raise self._failed(f"answered 0x{answer[0]:02X} for a segment")
            content += answer[1 : 8 - (answer[0] >> 1 & 7)]
            if answer[0] & _LAST:
                return content
            toggle ^= _TOGGLE
        raise self._failed(f"has more than {len(content)} bytes", "See the drive's manual")

    def _initiate(self, command: int, entry: Entry, data: bytes = b"") -> bytes:
        """Send a request for an object, and wait for its answer."""
        earlier, asked = self._earlier, self._asked
        self._earlier, self._asked = b"", False
        answer = self._request(command, entry.index, entry.subindex, data)
        self._earlier = bytes(self._message.data[1:4])
        if asked and answer[1:4] == earlier != self._earlier:
            answer = self._answer()  # the first was that to `ask`, which nobody waits for any more
        if answer[1:4] == self._earlier:
            return answer
        what = f"object {answer[2]:02X}{answer[1]:02X}:{answer[3]}"
        if answer[1:4] == earlier:
            raise self._failed(
                f"{what} was answered twice: two drives have node id {self.node[0]}",
                "Give each drive a node id of its own, or unplug one",
            )
        raise self._failed(f"answered for {what}; another SDO client is active")

    def _request(self, command: int, index: int, subindex: int, data: bytes = b"") -> bytes:
        """Send a request and wait for its answer; answers to earlier requests are dropped."""
        self._send(command, index, subindex, data)
        return self._answer()

    def _send(self, command: int, index: int, subindex: int, data: bytes = b"") -> None:
        """Send a request, or an abort."""
        self._answers.clear()
        _HEAD.pack_into(self._message.data, 0, command, index, subindex, data)
        self._link.send(self._message)

    def _answer(self) -> bytes:
        """Pump until an answer is received."""
        if not self._link.pump_until(lambda: bool(self._answers), self._limit_s):
            _, index, subindex, _ = _HEAD.unpack(self._message.data)
            self._send(_ABORT, index, subindex, _TIMED_OUT)
            remedy = "Is the drive powered and connected, with this node id and bit rate?"
            raise self._failed(f"no answer within {self._limit_s} s", remedy, ServoTimeout)
        answer = self._answers.popleft()
        if len(answer) != 8:
            raise self._failed(f"answered with {len(answer)} bytes instead of 8")
        if answer[0] == _ABORT:
            code = int.from_bytes(answer[4:], "little")
            raise self._refused(*self._doing, code, _ABORT_CODES.get(code, "a code that CiA 301 does not list"))
        return answer

    def _failed(
        self,
        what: str,
        remedy: str = "Is another master or configuration tool on the bus?",
        kind: type[ServoError] = ServoError,
    ) -> ServoError:
        """Error of the transfer in progress."""
        verb, entry = self._doing
        return self.failure(f"{verb} {entry}: {what}", remedy, kind)
