"""A run without periods reduced to means over 10 ms while it is read.

A mean over T is its own anti-aliasing filter: its response has a zero at every multiple of 1/T, which is what would
fold onto standstill. At 100 Hz, what would fold onto 0 to 8 Hz is damped by 21 dB or more, and 8 Hz itself by 0.1 dB;
position and torque go through the same filter. Means do not overlap, so that white noise stays white.

So that memory does not grow with the run, there are at most `MOST_MEANS`, 22 minutes at 10 ms: whenever there are more,
two by two become one. `verdict.sanity` refuses means that are too long for the motion.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import Excitation
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.reduction.repeated_values import RepeatCounter
from armload_identification.recording.row_block import RowBlock, joined

INTERVAL_S: Final = 0.01
MOST_MEANS: Final = 2**17
_FULL: Final = 0.5
"""A mean over less than this share of the samples that it should have is left out: it belongs to another moment."""


class TimeAverager:
    """Means over equal stretches of time.

    Args:
        excitation: What the run follows, where that is known.
        most_means: Means that are kept.
    """

    def __init__(self, excitation: Excitation | None, most_means: int = MOST_MEANS) -> None:
        self._excitation, self._most_means = excitation, most_means
        self._samples = 0
        self._width_s = 0.0
        self._start_s = 0.0
        self._open: RowBlock | None = None
        self._means: list[RowBlock] = []
        self._size = 0
        self._repeats: RepeatCounter | None = None

    def add(self, rows: RowBlock) -> None:
        """Go on with more rows."""
        effort = rows.effort
        if not rows.size:
            return
        if not self._samples:
            self._repeats = None if effort is None else RepeatCounter(rows.n)
            interval_s = float(np.median(np.diff(rows.time_s)))
            self._samples = max(int(INTERVAL_S / interval_s * (1.0 + 1e-6)), 1)
            self._width_s = self._samples * interval_s
            # Half an interval earlier, so that jitter moves no sample across an edge.
            self._start_s = float(rows.time_s[0]) - 0.5 * interval_s
        if self._repeats is not None and effort is not None:
            self._repeats.add(effort)
        rows = rows if self._open is None else joined([self._open, rows])
        number = self._number(rows)
        # Closed are whole pairs of stretches, so that two by two can become one at any time.
        closed = int(np.searchsorted(number, number[-1] - number[-1] % 2))
        self._open = rows.rows(slice(closed, None))
        if closed:
            self._keep(self._stretches(rows.rows(slice(0, closed))))

    def recording(self, source: RecordingSource) -> Recording:
        """The means as rows."""
        if self._open is not None:
            self._keep(self._stretches(self._open))
            self._open = None
        rows = joined(self._means)
        return Recording(
            time_s=rows.time_s,
            position_rad=rows.position_rad,
            velocity_rad_s=None,
            current_a=rows.current_a,
            torque_nm=rows.torque_nm,
            phase_s=rows.phase_s,
            excitation=self._excitation,
            source=source,
            repeats=None if self._repeats is None else self._repeats.result(),
        )

    def _number(self, rows: RowBlock) -> FloatArray:
        """Number of the stretch that each row lies in."""
        return np.floor((rows.time_s - self._start_s) / self._width_s)

    def _keep(self, means: RowBlock) -> None:
        """Add to the means; make two by two one where there are too many."""
        self._means.append(means)
        self._size += means.size
        while self._size > self._most_means:
            rows = joined(self._means)
            self._means = [_averaged(rows, self._number(rows) // 2.0, 1.0)]
            self._size = self._means[0].size
            self._width_s *= 2.0
            self._samples *= 2

    def _stretches(self, rows: RowBlock) -> RowBlock:
        """Means of the stretches that rows lie in."""
        return rows if self._samples == 1 else _averaged(rows, self._number(rows), _FULL * self._samples)


def _averaged(rows: RowBlock, number: FloatArray, fewest: float) -> RowBlock:
    """Means over rows of one number, where there are at least so many; the velocity is left out."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])
    count = np.diff(np.append(first, rows.size))
    full = count >= fewest

    def mean(values: FloatArray) -> FloatArray:
        size = count if values.ndim == 1 else count[:, None]
        return np.asarray(np.add.reduceat(values, first, axis=0) / size)[full]

    return RowBlock(
        time_s=mean(rows.time_s),
        position_rad=mean(rows.position_rad),
        velocity_rad_s=None,
        current_a=None if rows.current_a is None else mean(rows.current_a),
        torque_nm=None if rows.torque_nm is None else mean(rows.torque_nm),
        phase_s=None if rows.phase_s is None else mean(rows.phase_s),
    )
