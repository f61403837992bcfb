"""Torque offsets (60B2) on their way to zero. Pure.

A drive keeps the last offset it was given. Taken away at once it would be a step of torque, and the arm would jerk;
left alone it would stay until the torque goes. So every stop takes the offsets of all drives to zero together, in
even steps of one cycle, while the drives slow down on their own ramps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

OFFSET_FADE_S = 0.15
"""Torque offsets go to zero within this time."""


class OffsetFade:
    """Offsets of all drives, cycle by cycle.

    Args:
        permille: (n,) offsets to begin with, in the drives' units.
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
        """(n,) offsets of the next cycle; zeros from the end on."""
        self._left = max(0, self._left - 1)
        return [round(first * self._left / max(1, self._cycles)) for first in self._first]
