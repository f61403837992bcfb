"""Layer setting services: node id and bit rate of a node that has no switches for them.

Rules of this file:
- A node is addressed by its 128-bit identity (1018: vendor, product, revision, serial number), which no other node has.
- Fastscan finds a node without a node id, bit by bit; nodes that have one do not answer it.
- A setting is stored by the node and takes effect when it leaves the configuration state (node id), or at its next
  power-on (bit rate). Whatever ends, all nodes are set to the waiting state again.

References:
    CiA 305, 3 (services), 4 (protocols, bit timing table).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.driver_errors import LssRefused

TO_NODES, FROM_NODES = 0x7E5, 0x7E4
"""COB-IDs of the services."""
BIT_TIMINGS = {1_000_000: 0, 800_000: 1, 500_000: 2, 250_000: 3, 125_000: 4, 50_000: 6, 20_000: 7, 10_000: 8}
"""Index in the standard's table by bit rate."""

ANSWER_S = 0.05
"""Longest wait for an answer; fastscan waits for it up to 128 times."""
_SWITCH_ALL, _NODE_ID, _BIT_TIMING, _STORE = 0x04, 0x11, 0x13, 0x17
_SELECT, _SELECTED = (0x40, 0x41, 0x42, 0x43), 0x44
_FASTSCAN, _IDENTIFIED = 0x51, 0x4F
_ANY_ANSWER = 0x80
"""Number of bits checked by the first step of fastscan: none."""
_WORD_BITS = 32
_REFUSALS = {
    (_NODE_ID, 1): "it does not take this node id",
    (_BIT_TIMING, 1): "it does not support this bit rate",
    (_STORE, 1): "it cannot store its settings",
    (_STORE, 2): "it could not access its memory",
}


@dataclass(frozen=True, slots=True)
class LssAddress:
    """Identity of a node; all four numbers of 1018."""

    vendor_id: int
    product_code: int
    revision: int
    serial: int

    def __str__(self) -> str:
        return ":".join(f"0x{number:08X}" for number in astuple(self))


class LssMaster:
    """Layer setting services on one bus."""

    def __init__(self, link: BusLink) -> None:
        self._link = link
        self._answers: list[bytes] = []

    @contextmanager
    def services(self) -> Iterator[None]:
        """Subscribe to answers; after the block all nodes are in the waiting state."""
        with self._link.subscribed_meanwhile():
            self._link.subscribe(FROM_NODES, lambda data: self._answers.append(bytes(data)))
            self._send(_SWITCH_ALL, 0)
            try:
                yield
            finally:
                self._send(_SWITCH_ALL, 0)

    def find(self) -> LssAddress | None:
        """A node without a node id, which is then in the configuration state; None if there is none.

        Raises:
            LssRefused: a node answers inconsistently.
            BusError: the bus failed.
        """
        if not self._scan(0, _ANY_ANSWER, 0, 0):
            return None
        words = [0, 0, 0, 0]
        for sub in range(len(words)):
            for bit in reversed(range(_WORD_BITS)):
                if not self._scan(words[sub], bit, sub, sub):
                    words[sub] |= 1 << bit
            if not self._scan(words[sub], 0, sub, (sub + 1) % len(words)):
                raise LssRefused(f"a node answers fastscan inconsistently at word {sub + 1} of its identity")
        return LssAddress(*words)

    def select(self, address: LssAddress) -> None:
        """Set the node with this identity to the configuration state.

        Raises:
            LssRefused: no node has it.
            BusError: the bus failed.
        """
        for command, number in zip(_SELECT, astuple(address), strict=True):
            answer = self._ask(struct.pack("<BI3x", command, number), wait=command == _SELECT[-1])
        if answer is None or answer[0] != _SELECTED:
            raise LssRefused(f"no node with identity {address} answers; does it support LSS, at this bit rate?")

    def assign(self, node_id: int, bitrate: int | None) -> None:
        """Give the node in the configuration state a node id, and a bit rate from its next power-on, and store them.

        Raises:
            LssRefused: the node does not answer, or refuses a setting.
            BusError: the bus failed.
        """
        self._configure(_NODE_ID, node_id)
        if bitrate is not None:
            self._configure(_BIT_TIMING, 0, BIT_TIMINGS[bitrate])
        self._configure(_STORE)

    def _scan(self, number: int, bit: int, sub: int, following: int) -> bool:
        """One step of fastscan: whether a node without a node id matches."""
        answer = self._ask(struct.pack("<BIBBB", _FASTSCAN, number, bit, sub, following), wait=True)
        return answer is not None and answer[0] == _IDENTIFIED

    def _configure(self, command: int, first: int = 0, second: int = 0) -> None:
        """Send a setting and require that it is confirmed."""
        answer = self._ask(bytes([command, first, second]).ljust(8, b"\0"), wait=True)
        if answer is None or answer[0] != command:
            raise LssRefused("the node does not answer to a setting")
        if answer[1]:
            raise LssRefused(_REFUSALS.get((command, answer[1]), f"error {answer[1]}, {answer[2]} of its manufacturer"))

    def _send(self, command: int, first: int) -> None:
        """Send a command without an answer."""
        self._ask(bytes([command, first]).ljust(8, b"\0"), wait=False)

    def _ask(self, data: bytes, *, wait: bool) -> bytes | None:
        """Send a frame, and return the answer; None if none arrives in time."""
        self._link.drain()
        self._answers.clear()
        self._link.send_frame(TO_NODES, data)
        if not wait or not self._link.pump_until(lambda: bool(self._answers), ANSWER_S):
            return None
        return self._answers[0] if len(self._answers[0]) == 8 else None
