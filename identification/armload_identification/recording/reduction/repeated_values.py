"""How long a signal repeats one value, at its bound and elsewhere: what shows that it is cut off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_core.arrays import FloatArray

_AT_BOUND = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class RepeatedValues:
    """Longest repetitions in n signals.

    Attributes:
        bound: (n,) greatest magnitude.
        at_bound: (n,) how often in a row a value of that magnitude was repeated.
        elsewhere: (n,) how often in a row any other value was.
    """

    bound: FloatArray
    at_bound: FloatArray
    elsewhere: FloatArray


class RepeatCounter:
    """Counts repetitions block by block.

    Args:
        n: Number of signals.
    """

    def __init__(self, n: int) -> None:
        self._bound, self._at_bound, self._elsewhere = np.zeros(n), np.zeros(n), np.zeros(n)
        self._last, self._length = np.full(n, np.nan), np.zeros(n)

    def add(self, values: FloatArray) -> None:
        """Go on with more samples.

        Args:
            values: (N, n) the next ones, N at least 1.
        """
        for signal, column in enumerate(values.T):
            starts = np.concatenate([[0], np.flatnonzero(np.diff(column) != 0.0) + 1])
            lengths = np.diff(np.append(starts, column.size)).astype(np.float64)
            level = np.abs(column[starts])
            if column[0] == self._last[signal]:
                lengths[0] += self._length[signal]
            self._last[signal], self._length[signal] = column[-1], lengths[-1]
            greatest = float(level.max())
            if self._bound[signal] < greatest * _AT_BOUND:
                # What was the bound so far is a value like any other.
                self._elsewhere[signal] = max(self._elsewhere[signal], self._at_bound[signal])
                self._at_bound[signal] = 0.0
            self._bound[signal] = max(self._bound[signal], greatest)
            high = level >= self._bound[signal] * _AT_BOUND
            self._at_bound[signal] = max(self._at_bound[signal], lengths[high].max(initial=1.0) - 1.0)
            self._elsewhere[signal] = max(self._elsewhere[signal], lengths[~high].max(initial=1.0) - 1.0)

    def result(self) -> RepeatedValues:
        """What was counted so far."""
        return RepeatedValues(self._bound.copy(), self._at_bound.copy(), self._elsewhere.copy())


def repeated_values(values: FloatArray) -> RepeatedValues:
    """Repetitions in signals that are in memory as a whole.

    Args:
        values: (N, n).
    """
    counter = RepeatCounter(values.shape[1])
    counter.add(values)
    return counter.result()
