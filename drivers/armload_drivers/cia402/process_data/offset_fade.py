"""Fading of torque offsets (60B2) to zero.

A drive keeps its last offset. Removing it at once would be a step in torque, and the arm would jerk; otherwise it would
remain until the torque is removed. So every stop fades the offsets of all drives to zero together, in equal steps per
cycle, while the drives decelerate on their own ramps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

OFFSET_FADE_S = 0.15
"""Time in which torque offsets fade to zero."""


class OffsetFade:
    """Offsets of all drives, cycle by cycle.

    Args:
        permille: (n,) initial offsets, in the drives' units.
        cycle_s: Duration of a cycle.

    Attributes:
        done: Whether the last of them was zero.
    """

    def __init__(self, permille: Sequence[int], cycle_s: float) -> None:
        self._first = tuple(permille)
        self._cycles = self._left = max(1, math.ceil(OFFSET_FADE_S / cycle_s)) if any(self._first) else 0

    @property
    def done(self) -> bool:
        """Whether every offset has become zero."""
        return self._left == 0

    def next(self) -> list[int]:
        """(n,) offsets of the next cycle; zeros after the end."""
        self._left = max(0, self._left - 1)
        return [round(first * self._left / max(1, self._cycles)) for first in self._first]
