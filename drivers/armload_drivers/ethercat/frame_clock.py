"""When the frames of an EtherCAT line are sent. The master's frame is the clock of the arm.

There is no thread: if the caller hangs, is stopped or dies, frames end, and the drives' watchdogs stop the arm.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Protocol


class FrameClock(Protocol):
    """Decides when the next frame is sent."""

    def now_s(self) -> float:
        """Time in s."""

    def begin(self, cycle_s: float) -> None:
        """The first frame is due one period from now."""

    def next(self) -> tuple[float, int]:
        """Wait until the next frame is due.

        Returns:
            Its time, and the number of periods that were skipped because the caller was late.
        """


class DeadlineClock:
    """Absolute deadlines: missed ones are skipped, and never made up by a burst.

    Args:
        clock: Monotonic clock.
        sleep: Waits for a time in s.
    """

    def __init__(
        self, clock: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._cycle_s = self._due_s = 0.0

    def now_s(self) -> float:
        """Time of the monotonic clock."""
        return self._clock()

    def begin(self, cycle_s: float) -> None:
        """Set the first deadline."""
        self._cycle_s = cycle_s
        self._due_s = self._clock() + cycle_s

    def next(self) -> tuple[float, int]:
        """Sleep until the deadline."""
        late_s = self._clock() - self._due_s
        skipped = 0 if late_s <= 0.0 else math.floor(late_s / self._cycle_s) + 1
        self._due_s += skipped * self._cycle_s
        while (left_s := self._due_s - self._clock()) > 0.0:
            self._sleep(left_s)
        self._due_s += self._cycle_s
        return self._clock(), skipped
