"""Longest repetition of a value in a signal, at its bound and elsewhere, to detect clipping."""

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
        at_bound: (n,) longest sequence of repetitions of a value with that magnitude.
        elsewhere: (n,) longest sequence of repetitions of any other value.
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
        """Add more samples.

        Args:
            values: (N, n) the next samples, N at least 1.
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
                # The previous bound is now a value like any other.
                self._elsewhere[signal] = max(self._elsewhere[signal], self._at_bound[signal])
                self._at_bound[signal] = 0.0
            self._bound[signal] = max(self._bound[signal], greatest)
            high = level >= self._bound[signal] * _AT_BOUND
            self._at_bound[signal] = max(self._at_bound[signal], lengths[high].max(initial=1.0) - 1.0)
            self._elsewhere[signal] = max(self._elsewhere[signal], lengths[~high].max(initial=1.0) - 1.0)

    def result(self) -> RepeatedValues:
        """The repetitions counted so far."""
        return RepeatedValues(self._bound.copy(), self._at_bound.copy(), self._elsewhere.copy())


def repeated_values(values: FloatArray) -> RepeatedValues:
    """Repetitions in complete signals.

    Args:
        values: (N, n).
    """
    counter = RepeatCounter(values.shape[1])
    counter.add(values)
    return counter.result()
