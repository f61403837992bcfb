"""Whether something that should recur every cycle does, for the operator."""

from __future__ import annotations

TOLERANCE = 0.2
"""A period that differs from its nominal length by more than this share of it is reported."""


class Rhythm:
    """Counts periods that are too short or too long; whole periods that are skipped are counted elsewhere.

    Args:
        what: What recurs.
        period_s: Nominal period.
    """

    def __init__(self, what: str, period_s: float) -> None:
        self._what, self._period_s = what, period_s
        self._start_anew()

    def _start_anew(self) -> None:
        self._periods = self._irregular = 0
        self._shortest_s = self._longest_s = self._period_s
        self.begin()

    def begin(self) -> None:
        """The next time does not end a period."""
        self._last_s: float | None = None

    def note(self, time_s: float) -> None:
        """One occurrence, at a time on any clock."""
        last_s, self._last_s = self._last_s, time_s
        if last_s is None or time_s <= last_s:  # a clock that was set back
            return
        lasted_s = time_s - last_s
        lasted_s -= (max(1, round(lasted_s / self._period_s)) - 1) * self._period_s
        self._periods += 1
        if abs(lasted_s - self._period_s) > TOLERANCE * self._period_s:
            self._irregular += 1
            self._shortest_s = min(self._shortest_s, lasted_s)
            self._longest_s = max(self._longest_s, lasted_s)

    def take(self) -> str:
        """What was irregular since the last call, as text; empty if nothing was."""
        text = ""
        if self._irregular:
            text = (
                f"{self._irregular} of {self._periods} periods of {self._what} differ from {self._period_s * 1e3:g} ms "
                f"by more than a fifth ({self._shortest_s * 1e3:.2f} to {self._longest_s * 1e3:.2f} ms)"
            )
        self._start_anew()
        return text
