"""A run without periods reduced to means over 10 ms while it is read.

A mean over T is its own anti-aliasing filter: its response has zeros at the multiples of 1/T, which alias to 0 Hz. At
100 Hz, components that alias to 0 to 8 Hz are attenuated by 21 dB or more, and 8 Hz itself by 0.1 dB; position and
torque pass through the same filter. The means do not overlap, so that white noise stays white.

The mean of a torque is not the torque at the mean position: at 4 rad/s, of a mean over 20 ms, it is 3e-4 less. With N
samples in T, a mean x differs from the value at its time by (1 - 1/N^2) T^2/24 x'' to fourth order; that is taken off.

To bound memory there are at most `MOST_MEANS` means, 22 minutes at 10 ms; beyond that, pairs of means are merged.
`verdict.recording_checks` refuses means that are too long for the motion.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.reduction.reduction import Reduction
from armload_identification.recording.reduction.repeated_values import RepeatedValues
from armload_identification.recording.row_block import QUANTITIES, RowBlock, joined

INTERVAL_S: Final = 0.01
MOST_MEANS: Final = 2**17
_FEWEST_SHARE: Final = 0.5
"""A mean of less than this share of its samples is dropped, as its mean time differs from the interval's centre."""
_EVEN: Final = 0.1
"""How far, in intervals, means may lie from even times to count as neighbours."""
_LEARNT_FROM: Final = 1000
"""Rows from which the sampling interval is determined: a single pair of stamps may be off by the jitter."""


class TimeAverager(Reduction):
    """Means over equal intervals of time.

    Args:
        excitation: The excitation that the run follows, if known.
        most_means: Greatest number of means.
    """

    def __init__(self, excitation: Excitation | None, most_means: int = MOST_MEANS) -> None:
        super().__init__(_LEARNT_FROM)
        self._excitation, self._most_means = excitation, most_means
        self._open: list[RowBlock] = []
        self._means: list[RowBlock] = []

    def _used(self, rows: RowBlock) -> RowBlock:
        """All rows, without the velocity."""
        return replace(rows, velocity_rad_s=None)

    def _learn(self, rows: RowBlock) -> None:
        """Determine the intervals from the first rows."""
        interval_s = float(np.median(np.diff(rows.time_s)))
        self._samples = max(int(INTERVAL_S / interval_s * (1.0 + 1e-6)), 1)
        self._width_s = self._samples * interval_s
        # Half an interval earlier, so that jitter moves no sample across an edge.
        self._start_s = float(rows.time_s[0]) - 0.5 * interval_s

    def _reduce(self, rows: RowBlock) -> None:
        """Average the completed intervals."""
        rows = joined([*self._open, rows])
        number = self._interval_number(rows)
        # Only pairs of intervals are closed, so that pairs can be merged at any time.
        closed = int(np.searchsorted(number, number[-1] - number[-1] % 2))
        self._open = [rows.rows(slice(closed, None))]
        if closed:
            self._collect(rows.rows(slice(0, closed)))

    def _reduced(self, source: RecordingSource, repeats: RepeatedValues | None) -> Recording:
        """The means as rows."""
        self._collect(joined(self._open))
        rows = _at_their_times(joined(self._means), self._width_s, (1.0 - self._samples**-2.0) / 24.0)
        return Recording(**vars(rows), excitation=self._excitation, source=source, repeats=repeats)

    def _interval_number(self, rows: RowBlock) -> FloatArray:
        """Number of each row's interval."""
        return np.floor((rows.time_s - self._start_s) / self._width_s)

    def _collect(self, rows: RowBlock) -> None:
        """Add the means of the rows' intervals; merge pairs if there are too many."""
        if self._samples > 1:
            rows = _averaged(rows, self._interval_number(rows), _FEWEST_SHARE * self._samples)
        self._means.append(rows)
        while sum(means.size for means in self._means) > self._most_means:
            rows = joined(self._means)
            self._means = [_averaged(rows, self._interval_number(rows) // 2.0, 1.0)]
            self._width_s *= 2.0
            self._samples *= 2


def _averaged(rows: RowBlock, number: FloatArray, fewest: float) -> RowBlock:
    """Means over rows with the same number, if there are at least `fewest`."""
    _, first, count = np.unique(number, return_index=True, return_counts=True)
    full = count >= fewest

    def mean(values: FloatArray) -> FloatArray:
        size = count if values.ndim == 1 else count[:, None]
        return np.asarray(np.add.reduceat(values, first, axis=0) / size)[full]

    return rows.each(mean)


def _at_their_times(rows: RowBlock, width_s: float, curvature: float) -> RowBlock:
    """Values at the times of means over `width_s`, where two neighbours on each side follow evenly.

    The second derivative is taken over four intervals, so that the noise of a mean grows by 2 % at most. The arrays of
    the rows are changed.
    """
    if not curvature:  # the rows are single samples
        return rows
    even = np.abs(rows.time_s[4:] - rows.time_s[:-4] - 4.0 * width_s) < _EVEN * width_s
    inner = np.flatnonzero(even) + 2

    for name in QUANTITIES[1:]:  # all but the times
        means = getattr(rows, name)
        # One column at a time, and in place: a long run has 2^17 means.
        for column in () if means is None else np.atleast_2d(means.T):
            mean = column.copy()
            column[inner] -= 0.25 * curvature * (mean[inner + 2] - 2.0 * mean[inner] + mean[inner - 2])
    return rows
