"""Where SYNC comes from.

A source decides when the next SYNC leaves, sends it or sees it sent, and tells its time. The cycle calls `next`
once per cycle, after its RPDOs have left. There is no thread: while a source waits it pumps the bus. A caller
that hangs, is stopped or dies ends SYNC, whatever the source.

- `LockstepSync` for simulations: SYNC leaves at once, and time is advanced by one period for it.
- `TimerSync` for any interface: SYNC leaves at absolute deadlines. A late caller skips whole periods, which
  are counted; nothing is ever caught up with a burst.
- `bcm_sync.BcmSync` for SocketCAN: the kernel sends SYNC.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import can

from armload_drivers.canopen.bus_link import BusLink
from armload_drivers.cia402.object_dictionary import SYNC_DEFAULT_COB_ID
from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation.virtual_clock import Clock, VirtualClock

UNTOLD_S = 1.0
"""In lockstep, on the wall clock: how long to wait for drives that do not tell when they have acted."""
LOOK_S = 2e-3
"""In lockstep, on the wall clock: how often to look whether the drives have acted."""


@dataclass(frozen=True, slots=True)
class SyncTick:
    """One SYNC.

    Attributes:
        time_s: When it left, on the source's clock.
        skipped: Periods that passed without SYNC, or with one that nobody used, because the caller was late.
    """

    time_s: float
    skipped: int


class SyncSource(Protocol):
    """A source of SYNC.

    Attributes:
        heard: Its own SYNCs come back on the bus; where they do not, any SYNC received is somebody else's.
    """

    heard: bool

    def now_s(self) -> float:
        """Time on the clock that SYNCs are stamped with."""

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Start counting periods: the first SYNC is due one period from now.

        Args:
            link: The bus.
            cycle_s: Period.
            counter: Overflow value of the SYNC counter (1019); 0 sends SYNC without one.
        """

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Let the next SYNC leave.

        Args:
            link: The bus.
            on_sync: Called when all frames of earlier SYNCs have been handled, and none of this one.
        """

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Pump the bus until the feedback of the last SYNC is complete, or until it may not be waited for any longer.

        Raises:
            BusError: the bus failed.
            SimulationError: the simulated drives do not act any more.
        """

    def end(self, link: BusLink) -> None:
        """No more SYNCs until the next `begin`. Idempotent."""


def sync_data(counter: int) -> list[bytes]:
    """Data of consecutive SYNCs, to be repeated: none without a counter, else 1 to its overflow value."""
    return [bytes([number]) for number in range(1, counter + 1)] or [b""]


class _SentSync:
    """SYNC messages sent by this process, one after the other."""

    def __init__(self, counter: int = 0) -> None:
        self._messages = [
            can.Message(arbitration_id=SYNC_DEFAULT_COB_ID, data=data, is_extended_id=False)
            for data in sync_data(counter)
        ]
        self._next = 0

    def take(self) -> can.Message:
        """The message whose turn it is."""
        message = self._messages[self._next]
        self._next = (self._next + 1) % len(self._messages)
        return message


class LockstepSync:
    """SYNC in virtual time: as fast as master and drives can compute.

    Feedback is waited for as long as the drives' thread lives and has not acted on the SYNC, however long the machine
    takes: only what it did not send is missing.

    Args:
        clock: The clock that the simulated drives have as well.
        patience_s: On the wall clock, for drives that live and never act.
    """

    heard = False

    def __init__(self, clock: VirtualClock, patience_s: float = 60.0) -> None:
        self._clock = clock
        self._patience_s = patience_s
        self._cycle_s = 0.0
        self._messages = _SentSync()

    def now_s(self) -> float:
        """Virtual time."""
        return self._clock()

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Take over the period."""
        self._cycle_s = cycle_s
        self._messages = _SentSync(counter)

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Advance time by one period and send SYNC."""
        link.drain()
        self._clock.advance(self._cycle_s)
        on_sync()
        link.send(self._messages.take())
        return SyncTick(self._clock(), 0)

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Wait until the drives have acted; for drives that tell nothing, a while.

        Raises:
            SimulationError: the drives' thread has ended, or lives and does not act.
        """
        clock = self._clock
        if not clock.followed:
            link.pump_until(complete, UNTOLD_S)
            return
        deadline_s = time.monotonic() + self._patience_s
        while not complete():
            if clock.settled:
                # All that is going to come is there.
                link.drain()
                return
            clock.require_follower()
            if time.monotonic() > deadline_s:
                raise SimulationError(
                    f"the simulated drives live and have not acted on a SYNC for {self._patience_s} s. Does the plant "
                    "hang, or is this computer far too busy?"
                )
            link.pump(LOOK_S)

    def end(self, link: BusLink) -> None:
        """Nothing is running."""


class TimerSync:
    """SYNC at absolute deadlines, sent by the calling thread.

    Args:
        feedback_share: Share of the cycle that feedback may take; the rest is left to the caller.
        clock: Monotonic clock.
    """

    heard = False

    def __init__(self, feedback_share: float = 0.6, clock: Clock = time.monotonic) -> None:
        self._feedback_share = feedback_share
        self._clock = clock
        self._cycle_s = 0.0
        self._due_s = 0.0
        self._messages = _SentSync()

    def now_s(self) -> float:
        """Time on the monotonic clock."""
        return self._clock()

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Set the first deadline."""
        self._cycle_s = cycle_s
        self._due_s = self._clock() + cycle_s
        self._messages = _SentSync(counter)

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Pump the bus until the deadline and send SYNC; a deadline that has passed is skipped."""
        late_s = self._clock() - self._due_s
        skipped = 0 if late_s <= 0.0 else math.floor(late_s / self._cycle_s) + 1
        self._due_s += skipped * self._cycle_s
        while (left_s := self._due_s - self._clock()) > 0.0:
            link.pump(left_s)
        self._due_s += self._cycle_s
        link.drain()
        on_sync()
        time_s = self._clock()
        link.send(self._messages.take())
        return SyncTick(time_s, skipped)

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Wait for a share of the cycle."""
        link.pump_until(complete, self._feedback_share * self._cycle_s)

    def end(self, link: BusLink) -> None:
        """Nothing is running."""
