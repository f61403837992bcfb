"""How late the cycles of a run were: a histogram for its recording and report."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from typing import Final

UP_TO_MS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Upper edges of the bins; a further one has no upper edge."""


class Lateness:
    """Counts by how much each cycle came later after the one before than a period, seen by the program.

    A delay counts once: the cycle after it, which comes early, counts as in time.

    Args:
        cycle_s: Duration of a cycle.
        clock: Monotonic clock of this computer in s; None if the servos run in virtual time.
    """

    def __init__(self, cycle_s: float, clock: Callable[[], float] | None) -> None:
        self._cycle_s, self._clock = cycle_s, clock
        self._cycles = [0] * (len(UP_TO_MS) + 1)
        self._greatest_ms = 0.0
        self.begin()

    def begin(self) -> None:
        """The next cycle is the first since the drives were enabled."""
        self._last_s: float | None = None

    def note(self, servos_s: float) -> None:
        """A cycle, at this time on the servos' clock."""
        now_s, last_s = servos_s if self._clock is None else self._clock(), self._last_s
        self._last_s = now_s
        if last_s is not None:
            late_ms = 1e3 * max(0.0, now_s - last_s - self._cycle_s)
            self._cycles[bisect_left(UP_TO_MS, late_ms)] += 1
            self._greatest_ms = max(self._greatest_ms, late_ms)

    def counted(self) -> dict[str, object]:
        """As in `run_format.LATENESS_ATTACHMENT`; empty if there was no cycle."""
        if not any(self._cycles):
            return {}
        return {"up_to_ms": UP_TO_MS, "cycles": self._cycles, "greatest_ms": round(self._greatest_ms, 4)}
