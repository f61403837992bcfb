"""Repetitions of a value in a signal, to detect clipping, and values that no longer follow the motion."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray

_AT_BOUND: Final = 1.0 - 1e-9
_LONG_REPETITION: Final = 50
"""Samples of the same value from which the motion meanwhile matters; drives update their values more often."""


@dataclass(frozen=True, eq=False)
class RepeatedValues:
    """Longest repetitions in the efforts of n joints.

    Attributes:
        bound: (n,) greatest magnitude.
        at_bound: (n,) longest sequence of repetitions of a value with that magnitude.
        elsewhere: (n,) longest sequence of repetitions of any other value.
        turned_rad: (n,) furthest way that the joint went there and back during a long sequence.
        turned_for: (n,) number of samples of that sequence.
        turned_at: (n,) its value.
    """

    bound: FloatArray
    at_bound: FloatArray
    elsewhere: FloatArray
    turned_rad: FloatArray
    turned_for: FloatArray
    turned_at: FloatArray

    def joints(self, columns: NDArray[np.intp]) -> RepeatedValues:
        """The repetitions of some joints, in a given order."""
        return RepeatedValues(**{field.name: getattr(self, field.name)[columns] for field in fields(self)})


class _Stretch(NamedTuple):
    """Motion of a joint while its value stays the same.

    Attributes:
        first: Position at the beginning.
        low: Least position.
        high: Greatest position.
        way: Furthest way there and back: how far the joint had been beyond both its first and a later position.
    """

    first: float
    low: float
    high: float
    way: float


def _stretch(position: FloatArray, before: _Stretch | None) -> _Stretch:
    """A stretch, or the continuation of one."""
    first, least, greatest, furthest = before or (*3 * [float(position[0])], 0.0)
    low = np.minimum(np.minimum.accumulate(position), least)
    high = np.maximum(np.maximum.accumulate(position), greatest)
    way = np.maximum(high - np.maximum(position, first), np.minimum(position, first) - low)
    return _Stretch(first, float(low[-1]), float(high[-1]), max(float(way.max()), furthest))


class RepeatCounter:
    """Counts repetitions block by block.

    Attributes:
        found: The repetitions counted so far.
    """

    def __init__(self, n: int) -> None:
        self.found = RepeatedValues(*np.zeros((6, n)))
        self._last, self._length = np.full(n, np.nan), np.zeros(n)
        self._open: list[_Stretch | None] = [None] * n

    def add(self, values: FloatArray, position: FloatArray) -> None:
        """Add more samples.

        Args:
            values: (N, n) the next samples, N at least 1.
            position: (N, n) positions of the joints.
        """
        found = self.found
        for signal, column in enumerate(values.T):
            starts = np.concatenate([[0], np.flatnonzero(np.diff(column) != 0.0) + 1])
            ends = np.append(starts[1:], column.size)
            lengths = (ends - starts).astype(np.float64)
            level = np.abs(column[starts])
            if column[0] == self._last[signal]:
                lengths[0] += self._length[signal]
            else:
                self._open[signal] = None
            # The last one may become long with the next samples.
            for place in np.flatnonzero(np.append(lengths[:-1] >= _LONG_REPETITION, True)).tolist():
                before = None if place else self._open[signal]
                stretch = _stretch(position[starts[place] : ends[place], signal], before)
                if lengths[place] >= _LONG_REPETITION and stretch.way >= found.turned_rad[signal]:
                    found.turned_rad[signal], found.turned_for[signal] = stretch.way, lengths[place]
                    found.turned_at[signal] = column[starts[place]]
            self._open[signal] = stretch
            self._last[signal], self._length[signal] = column[-1], lengths[-1]
            greatest = float(level.max())
            if found.bound[signal] < greatest * _AT_BOUND:
                # The previous bound is now a value like any other.
                found.elsewhere[signal] = max(found.elsewhere[signal], found.at_bound[signal])
                found.at_bound[signal] = 0.0
            found.bound[signal] = max(found.bound[signal], greatest)
            high = level >= found.bound[signal] * _AT_BOUND
            found.at_bound[signal] = max(found.at_bound[signal], lengths[high].max(initial=1.0) - 1.0)
            found.elsewhere[signal] = max(found.elsewhere[signal], lengths[~high].max(initial=1.0) - 1.0)


def repeated_values(values: FloatArray, position: FloatArray) -> RepeatedValues:
    """Repetitions in complete signals.

    Args:
        values: (N, n).
        position: (N, n) positions of the joints.
    """
    counter = RepeatCounter(values.shape[1])
    counter.add(values, position)
    return counter.found
