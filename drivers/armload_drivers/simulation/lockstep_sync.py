"""SYNC in virtual time: as fast as master and simulated drives can compute, on a bus of this process."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import SentSync, SyncTick
from armload_drivers.simulation.virtual_clock import VirtualClock


class LockstepSync:
    """SYNC leaves at once, and time is advanced by one period for it.

    The drives have acted when SYNC has been sent (`lockstep_bus`): what is not there by then is missing.

    Args:
        clock: The clock that the simulated drives have as well.
    """

    heard = False

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._cycle_s = 0.0
        self._messages = SentSync()

    def now_s(self) -> float:
        """Virtual time."""
        return self._clock()

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Take over the period."""
        self._cycle_s = cycle_s
        self._messages = SentSync(counter)

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Advance time by one period and send SYNC."""
        link.drain()
        self._clock.advance(self._cycle_s)
        on_sync()
        link.send(self._messages.take())
        return SyncTick(self._clock(), 0)

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Take in what the drives have sent.

        Raises:
            SimulationError: they do not act any more.
        """
        link.drain()
        if not complete():
            self._clock.require_follower()

    def end(self, link: BusLink) -> None:
        """Nothing is running."""
