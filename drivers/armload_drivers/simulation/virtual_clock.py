"""Time of a simulation in which master and drives run in lockstep instead of real time."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.driver_errors import SimulationError


class VirtualClock:
    """A clock that stands still until it is advanced.

    `LockstepSync` advances it by one cycle before every SYNC. At a given SYNC every reader gets the same time in every
    run, which makes simulations repeatable. Time is kept in integer nanoseconds, so a million cycles of 4 ms are
    exactly 4000 s.
    """

    def __init__(self) -> None:
        self._time_ns = 0
        self._end: Callable[[], str] = lambda: "none are running"

    def __call__(self) -> float:
        """Present time in seconds."""
        return self._time_ns / 1e9

    def advance(self, step_s: float) -> None:
        """Advance the time.

        Args:
            step_s: Step; rounded to a nanosecond.
        """
        self._time_ns += round(step_s * 1e9)

    def follow(self, end: Callable[[], str]) -> None:
        """Register the follower of this clock.

        Args:
            end: Returns why the follower is no longer active; empty while it is.
        """
        self._end = end

    def require_follower(self) -> None:
        """Refuse to continue without an active follower.

        Raises:
            SimulationError: the follower is no longer active.
        """
        why = self._end()
        if why:
            raise SimulationError(f"the simulated drives no longer act: {why}")
