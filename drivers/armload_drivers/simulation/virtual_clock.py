"""Time for simulations that do not run on the wall clock."""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.driver_errors import SimulationError

Clock = Callable[[], float]
"""Tells a monotonic time in seconds."""


class VirtualClock:
    """A clock that stands still until somebody advances it.

    `LockstepSync` advances it by one cycle before every SYNC. Whoever reads it at a SYNC gets the same time
    in every run, which makes a simulation repeatable. Time is kept in whole nanoseconds, so that a million
    cycles of 4 ms are 4000 s exactly.

    Whoever lives by it (`follow`) tells when it has done all that a time asked of it (`acted`). So nobody has to guess
    from the wall clock, on however busy a machine, whether an answer is late or is not going to come.

    Attributes:
        followed: Whether somebody lives by it.
    """

    def __init__(self) -> None:
        self._time_ns = 0
        self._acted_s = -1.0
        self._end: Callable[[], str] = _nobody
        self.followed = False

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
            end: Tells why the follower does not live any more, in words; empty while it does.
        """
        self._end, self.followed = end, True

    def acted(self, time_s: float) -> None:
        """The follower has done all that it does at a time."""
        self._acted_s = time_s

    @property
    def settled(self) -> bool:
        """Whether the follower has done all that it does at the present time."""
        return self._acted_s >= self()

    def require_follower(self) -> None:
        """Refuse to wait for nobody.

        Raises:
            SimulationError: the follower does not live any more.
        """
        why = self._end()
        if why:
            raise SimulationError(f"the simulated drives do not act any more: {why}")


def _nobody() -> str:
    """Nobody lives by the clock."""
    return "there are none"
