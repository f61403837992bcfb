"""The buses of one arm as one python-can bus, so that master, drives and listener need no knowledge of a second one.

Rules of this file:
- Node ids are unique in the arm. A frame of a node goes to its bus, and is received from that bus only: the same COB-ID
  on another bus is another device's. SYNC, the master's heartbeat, and NMT commands to all nodes go to every bus.
- One source paces all buses, since two timers of a kernel drift apart. A SYNC that the master sends goes to every bus;
  one that the kernel sends on the first is sent on the others as soon as it is received, before anything else. A stale
  one is not sent on, so that a process that was stopped makes up for nothing.
- An error of one bus is an error of all: it is raised, and the arm stops.

References:
    CiA 301, 7.3.3 (pre-defined connection set: the low seven bits of a COB-ID are the node id).
"""

from __future__ import annotations

import select
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum, auto
from typing import Any

import can

from armload_drivers.cia402.bus_budget import FRAME_BITS
from armload_drivers.cia402.object_dictionary import NMT_COB_ID, SYNC_DEFAULT_COB_ID

POLL_S = 5e-4
"""Wait for one bus of several that cannot be waited for together."""
_FRESH = 0.5
"""Greatest age, and least distance, of a SYNC that is sent on, in cycles."""
_MOST_SKEWS = 100_000
_NODE = 0x7F
_LSS = frozenset({0x7E4, 0x7E5})


class BusRole(Enum):
    """Who uses the buses."""

    MASTER = auto()
    """Sends SYNC itself, or only inspects."""
    PACED_BY_KERNEL = auto()
    """The master of an arm on whose first bus the kernel sends SYNC."""
    DRIVES = auto()
    """Simulated drives, which answer the SYNC of their own bus."""
    LISTENER = auto()
    """Only receives; the SYNC of the first bus counts."""


class JoinedBus(can.BusABC):
    """Several buses of one arm.

    Args:
        buses: Open buses; `shutdown` closes them.
        members: Node ids of the arm's drives on each of them.
        role: Who uses them.
        cycle_s: SYNC period.
        in_lockstep: Whether nothing arrives during a wait.

    Attributes:
        everywhere: Whether frames of the arm's nodes are sent to, and received from, every bus.
        bits: Worst-case bits of all frames sent and received, by bus.
        parts: The buses.
    """

    def __init__(
        self,
        buses: Sequence[can.BusABC],
        members: Sequence[frozenset[int]],
        role: BusRole,
        cycle_s: float,
        *,
        in_lockstep: bool = False,
    ) -> None:
        super().__init__(channel="joined")
        self.channel_info = " and ".join(str(bus.channel_info) for bus in buses)
        self.everywhere = False
        self.bits = [0] * len(buses)
        self.parts, self._role, self._cycle_s, self._in_lockstep = tuple(buses), role, cycle_s, in_lockstep
        self._owner = {node_id: number for number, nodes in enumerate(members) for node_id in nodes}
        self._all = tuple(range(len(buses)))
        self._heads: list[can.Message | None] = [None] * len(buses)
        self._relayed_s = 0.0
        self._skews_s: deque[float] = deque(maxlen=_MOST_SKEWS)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to the buses that it is for; all are tried before an error is raised.

        Raises:
            CanError: a bus failed.
        """
        failure: Exception | None = None
        begun_s = 0.0
        targets = self._targets(msg.arbitration_id, msg.data)
        for number in targets:
            try:
                self.parts[number].send(msg, timeout)
                self.bits[number] += FRAME_BITS[msg.dlc]
            except (can.CanError, OSError) as error:
                failure = failure or error
            begun_s = begun_s or time.monotonic()
        if failure is not None:
            raise failure
        if msg.arbitration_id == SYNC_DEFAULT_COB_ID and not self._in_lockstep:
            self._skews_s.append(time.monotonic() - begun_s)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The oldest frame of all buses.

        Raises:
            CanError: a bus failed.
        """
        deadline_s = time.monotonic() + (timeout or 0.0)
        while True:
            message = self._oldest()
            if message is not None:
                return message
            left_s = deadline_s - time.monotonic()
            if self._in_lockstep or (timeout is not None and left_s <= 0.0):
                return None
            self._wait(POLL_S if timeout is None else left_s)

    @contextmanager
    def reaching_everywhere(self) -> Iterator[None]:
        """Within the block, frames of the arm's nodes are sent to, and received from, every bus."""
        self.everywhere = True
        try:
            yield
        finally:
            self.everywhere = False

    def listen(self, listener: Callable[[can.Message], None] | None) -> None:
        """In lockstep: act on frames as they are sent; see `simulation.lockstep_bus`."""
        for number, bus in enumerate(self.parts):
            part: Any = bus
            part.listen(None if listener is None else self._passed_on(number, listener))

    def take_skew(self) -> str:
        """How far apart SYNC was on the buses since the last call, as text; empty if nothing was measured."""
        skews_s = sorted(self._skews_s)
        self._skews_s.clear()
        if not skews_s:
            return ""
        middle_ms, worst_ms = 1e3 * skews_s[len(skews_s) // 2], 1e3 * skews_s[-1]
        return f"SYNC reached the last bus {middle_ms:.2f} ms after the first (median; at most {worst_ms:.2f} ms)"

    def shutdown(self) -> None:
        """Close all buses. Idempotent."""
        super().shutdown()
        for bus in self.parts:
            bus.shutdown()

    # Routes --------------------------------------------------------------------------------------------------

    def _targets(self, cob_id: int, data: bytearray) -> Sequence[int]:
        """Buses that a frame is for."""
        if cob_id in _LSS or self.everywhere:
            return self._all
        node_id = data[1] if cob_id == NMT_COB_ID and len(data) > 1 else cob_id & _NODE
        owner = self._owner.get(node_id)
        return self._all if owner is None else (owner,)

    def _accepts(self, number: int, message: can.Message) -> bool:
        """Whether a frame of a bus concerns the arm."""
        cob_id = message.arbitration_id
        self.bits[number] += FRAME_BITS[message.dlc]
        message.channel = number
        if message.is_error_frame or cob_id in _LSS or cob_id == NMT_COB_ID:
            return True
        if cob_id != SYNC_DEFAULT_COB_ID:
            return self.everywhere or self._owner.get(cob_id & _NODE, number) == number
        if number == 0:
            if self._role is BusRole.PACED_BY_KERNEL and not message.is_rx:
                self._relay(message)
        elif self._role is not BusRole.DRIVES:
            message.is_rx = True  # the master's own SYNC is not received there: it is another producer's
            return self._role is not BusRole.LISTENER
        return True

    def _relay(self, message: can.Message) -> None:
        """Send the kernel's SYNC on the other buses, while it is fresh."""
        now_s = time.time()
        if now_s - message.timestamp > _FRESH * self._cycle_s or now_s - self._relayed_s < _FRESH * self._cycle_s:
            return
        self._relayed_s = now_s
        for number in self._all[1:]:
            self.parts[number].send(message)
            self.bits[number] += FRAME_BITS[message.dlc]
        self._skews_s.append(time.time() - message.timestamp)

    def _oldest(self) -> can.Message | None:
        """The oldest frame that has been received, of those that concern the arm."""
        while True:
            for number, bus in enumerate(self.parts):
                if self._heads[number] is None:
                    self._heads[number] = bus.recv(0.0)
            waiting = [(head.timestamp, number) for number, head in enumerate(self._heads) if head is not None]
            if not waiting:
                return None
            _, number = min(waiting)
            message, self._heads[number] = self._heads[number], None
            if message is not None and self._accepts(number, message):
                return message

    def _wait(self, longest_s: float) -> None:
        """Wait until a frame is received, or the time is over."""
        try:
            sockets = [bus.fileno() for bus in self.parts]
        except NotImplementedError:
            for number, bus in enumerate(self.parts):
                self._heads[number] = bus.recv(min(longest_s, POLL_S))
        else:
            select.select(sockets, (), (), longest_s)

    def _passed_on(self, number: int, listener: Callable[[can.Message], None]) -> Callable[[can.Message], None]:
        """A listener for the frames of one bus that concern the arm."""

        def take(message: can.Message) -> None:
            if self._accepts(number, message):
                listener(message)

        return take
