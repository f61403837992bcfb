"""When a cycle begins: frames of an EtherCAT line, SYNC on a CAN bus without the kernel's help.

There is no thread: if the caller hangs, is stopped or dies, cycles end, and the drives' watchdogs stop the arm.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable


class DeadlineClock:
    """Absolute deadlines: missed ones are skipped, and never made up by a burst.

    Args:
        clock: Monotonic clock.
        wait: Waits for at most a time in s.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, wait: Callable[[float], object] = time.sleep
    ) -> None:
        self._clock, self._wait = clock, wait
        self._cycle_s = self._due_s = 0.0

    def now_s(self) -> float:
        """Time of the monotonic clock."""
        return self._clock()

    def begin(self, cycle_s: float) -> None:
        """The first cycle is due one period from now."""
        self._cycle_s = cycle_s
        self._due_s = self._clock() + cycle_s

    def next(self) -> tuple[float, int]:
        """Wait until the next cycle is due.

        Returns:
            Its time, and the number of periods that were skipped because the caller was late.
        """
        late_s = self._clock() - self._due_s
        skipped = 0 if late_s <= 0.0 else math.floor(late_s / self._cycle_s) + 1
        self._due_s += skipped * self._cycle_s
        while (left_s := self._due_s - self._clock()) > 0.0:
            self._wait(left_s)
        self._due_s += self._cycle_s
        return self._clock(), skipped
