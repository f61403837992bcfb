"""Time for simulations that do not run on the wall clock."""

from __future__ import annotations

from collections.abc import Callable

Clock = Callable[[], float]
"""Tells a monotonic time in seconds."""


class VirtualClock:
    """A clock that stands still until somebody advances it.

    `LockstepSync` advances it by one cycle before every SYNC. Whoever reads it at a SYNC gets the same time
    in every run, which makes a simulation repeatable. Time is kept in whole nanoseconds, so that a million
    cycles of 4 ms are 4000 s exactly.
    """

    def __init__(self) -> None:
        self._time_ns = 0

    def __call__(self) -> float:
        """Present time in seconds."""
        return self._time_ns / 1e9

    def advance(self, step_s: float) -> None:
        """Let time pass.

        Args:
            step_s: How much; rounded to a nanosecond.
        """
        self._time_ns += round(step_s * 1e9)
