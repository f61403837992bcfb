"""Sources of SYNC.

A source decides when the next SYNC is sent, sends it or observes it, and reports its time. The cycle calls `next` once
per cycle, after sending its RPDOs. There is no thread: a waiting source pumps the bus. With every source, SYNC ends if
the caller hangs, is stopped or dies.

- `TimerSync` for any interface: SYNC is sent at absolute deadlines. A late caller skips complete periods, which are
  counted; they are never made up by a burst.
- `kernel_sync.BcmSync` for SocketCAN: the kernel sends SYNC.
- `simulation.lockstep_sync.LockstepSync` for simulations: SYNC is sent immediately, and virtual time advances.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from itertools import cycle
from typing import NamedTuple

import can

from armload_drivers.bus.bus_link import BusLink, data_frame
from armload_drivers.cia402.object_dictionary import SYNC_DEFAULT_COB_ID
from armload_drivers.cia402.timeouts import FEEDBACK_SHARE
from armload_drivers.deadline_clock import DeadlineClock

Clock = Callable[[], float]
"""Returns a monotonic time in seconds."""


class SyncTick(NamedTuple):
    """One SYNC.

    Attributes:
        time_s: Time at which it was sent, on the source's clock.
        skipped: Number of periods without SYNC, or with an unused one, because the caller was late.
    """

    time_s: float
    skipped: int


class SyncSource(ABC):
    """A source of SYNC.

    Args:
        clock: Monotonic clock, on which SYNCs are stamped.

    Attributes:
        heard: Whether its own SYNCs are received back; if not, any SYNC received is from another node.
    """

    heard = False

    def __init__(self, clock: Clock = time.monotonic) -> None:
        self._clock = clock
        self._cycle_s = 0.0

    def now_s(self) -> float:
        """Time in s on the clock of the SYNC stamps."""
        return self._clock()

    @abstractmethod
    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Start counting periods: the first SYNC is due one period from now.

        Args:
            cycle_s: Period.
            counter: Overflow value of the SYNC counter (1019); 0 sends SYNC without one.
        """

    @abstractmethod
    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Wait for, and if necessary send, the next SYNC.

        Args:
            on_sync: Called after all frames of earlier SYNCs and before any frame of this one.
        """

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Pump the bus until the feedback of the last SYNC is complete, or a share of the cycle is over.

        Raises:
            BusError: the bus failed.
            DriverError: no node is left that could answer.
        """
        link.pump_until(complete, FEEDBACK_SHARE * self._cycle_s)

    def end(self, link: BusLink) -> None:  # noqa: B027 - SYNC that this process sends ends with the calls of `next`
        """Stop SYNC until the next `begin`. Idempotent."""


def sync_data(counter: int) -> list[bytes]:
    """Data of consecutive SYNCs, repeated cyclically: empty without a counter, else 1 to its overflow value."""
    return [bytes([number]) for number in range(1, counter + 1)] or [b""]


def sync_messages(counter: int = 0) -> Iterator[can.Message]:
    """SYNC messages for sending by this process, in sequence, without end."""
    return cycle([data_frame(SYNC_DEFAULT_COB_ID, data) for data in sync_data(counter)])


class TimerSync(SyncSource):
    """SYNC at absolute deadlines, sent by the calling thread."""

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Set the first deadline."""
        self._cycle_s, self._deadlines = cycle_s, DeadlineClock(self._clock, link.pump)
        self._deadlines.begin(cycle_s)
        self._messages = sync_messages(counter)

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Pump the bus until the deadline and send SYNC; missed deadlines are skipped."""
        _, skipped = self._deadlines.next()
        link.drain()
        on_sync()
        time_s = self._clock()
        link.send(next(self._messages))
        return SyncTick(time_s, skipped)
