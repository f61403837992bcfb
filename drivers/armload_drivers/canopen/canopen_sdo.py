"""SDO over CAN.

The client is canopen's, but waits by pumping the bus instead of using a receive thread. So there is never more than one
request to a node in progress, and every wait has a limit.
"""

from __future__ import annotations

import logging
import struct
from collections import deque

from canopen import ObjectDictionary
from canopen.sdo import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.bus.bus_link import BusLink, data_frame
from armload_drivers.cia402.object_dictionary import SDO_RX_BASE, SDO_TX_BASE, Entry
from armload_drivers.driver_errors import ServoTimeout

# canopen logs every abort, which its caller reports; without a handler Python would print it to the operator.
logging.getLogger("canopen").addHandler(logging.NullHandler())

_INITIATE = frozenset({1, 2})
"""Client commands whose response repeats index and sub-index: initiate download, initiate upload."""


_UPLOADED = 2
"""Server command with the value of an object, as opposed to an abort."""
_HEAD = struct.Struct("<BHB")
"""Command, index and sub-index of a frame."""


class _NoAnswer(SdoCommunicationError):  # type: ignore[misc]
    """The node did not answer in time."""


class _AnsweredTwice(SdoCommunicationError):  # type: ignore[misc]
    """One request was answered by two nodes, or the answer to another client's request for the same object came."""


class _PumpedSdoClient(SdoClient):  # type: ignore[misc]
    """canopen's client, waiting by pumping the bus."""

    timeout_s: float

    def __init__(self, node_id: int, link: BusLink) -> None:
        super().__init__(SDO_RX_BASE + node_id, SDO_TX_BASE + node_id, ObjectDictionary())
        self._link = link
        self._answers: deque[bytes] = deque()
        self._earlier = b""
        self._asked = False
        self._asking = data_frame(self.rx_cobid, bytes(8))
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
            node_id = self.rx_cobid - SDO_RX_BASE
            raise _AnsweredTwice(
                f"{what} was answered twice: two drives have node id {node_id}, or another SDO client is active"
            )
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


class CanopenSdo(SdoChannel):
    """SDO access to one node.

    Args:
        joint: Name of its joint, for errors.
        timeout_s: Limit of one request.
    """

    def __init__(self, node_id: int, joint: str, link: BusLink, timeout_s: float) -> None:
        super().__init__(node_id, joint, timeout_s)
        self._link, self._client = link, _PumpedSdoClient(node_id, link)

    def ask(self, entry: Entry) -> None:
        """Request an object of up to four bytes without waiting for the answer."""
        self._client.ask(entry)

    def _take(self) -> bytes | None:
        """The answer to `ask`; None if no value has arrived."""
        found = self._client.take()
        return None if found is None else found[4:]

    def _wait(self, time_s: float) -> None:
        """Pump the bus for this time."""
        self._link.pump_for(time_s)

    def _transfer(self, entry: Entry, data: bytes | None) -> bytes:
        """Write `data`, or read if it is None."""
        verb, self._client.timeout_s = "reading" if data is None else "writing", self._limit_s
        try:
            if data is None:
                with self._client.open(entry.index, entry.subindex, buffering=0) as stream:
                    return bytes(stream.read())
            self._client.write_expedited(entry, data)
        except SdoAbortedError as error:
            text = SdoAbortedError.CODES.get(error.code, "a code that CiA 301 does not list")
            raise self._refused(verb, entry, error.code, text) from error
        except _NoAnswer as error:
            raise ServoTimeout(
                *self.node,
                self.step,
                f"{verb} {entry}: {error}",
                "Is the drive powered and connected, with this node id and bit rate?",
            ) from error
        except _AnsweredTwice as error:
            raise self.failure(
                f"{verb} {entry}: {error}",
                "Give each drive a node id of its own, or end the other master or configuration tool",
            ) from error
        except SdoCommunicationError as error:
            raise self.failure(
                f"{verb} {entry}: {error}", "Is another master or configuration tool on the bus?"
            ) from error
        return b""
