"""SYNC in virtual time: as fast as master and simulated drives can compute, on a bus inside this process."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import SyncSource, SyncTick, sync_messages
from armload_drivers.simulation.virtual_clock import VirtualClock


class LockstepSync(SyncSource):
    """Sends SYNC immediately, after advancing time by one period.

    When SYNC has been sent, the drives have already acted (`lockstep_bus`): feedback not received by then is missing.

    Args:
        clock: The clock, shared with the simulated drives.
    """

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__(clock)
        self._virtual = clock

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Set the period."""
        self._cycle_s = cycle_s
        self._messages = sync_messages(counter)

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Advance time by one period and send SYNC."""
        link.drain()
        self._virtual.advance(self._cycle_s)
        on_sync()
        link.send(next(self._messages))
        return SyncTick(self._clock(), 0)

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Process the frames of the drives.

        Raises:
            SimulationError: the drives are no longer active.
        """
        link.drain()
        if not complete():
            self._virtual.require_follower()
