"""Time of a simulation whose master and drives run in lockstep instead of on the wall clock."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.driver_errors import SimulationError


class VirtualClock:
    """A clock that stands still until it is advanced.

    `LockstepSync` advances it by one cycle before every SYNC. Every reader at a SYNC gets the same time
    in every run, which makes a simulation repeatable. Time is kept in whole nanoseconds, so that a million
    cycles of 4 ms are 4000 s exactly.
    """

    def __init__(self) -> None:
        self._time_ns = 0
        self._end: Callable[[], str] = _no_follower

    def __call__(self) -> float:
        """Present time in seconds."""
        return self._time_ns / 1e9

    def advance(self, step_s: float) -> None:
        """Let time pass.

        Args:
            step_s: How much; rounded to a nanosecond.
        """
        self._time_ns += round(step_s * 1e9)

    def follow(self, end: Callable[[], str]) -> None:
        """Live by this clock from now on.

        Args:
            end: Says why the follower does not live any more, in words; empty while it does.
        """
        self._end = end

    def require_follower(self) -> None:
        """Refuse to let time pass without a follower.

        Raises:
            SimulationError: the follower does not live any more.
        """
        why = self._end()
        if why:
            raise SimulationError(f"the simulated drives no longer act: {why}")


def _no_follower() -> str:
    """The follower of a clock that has none."""
    return "none are running"
