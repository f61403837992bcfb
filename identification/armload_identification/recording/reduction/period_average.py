"""A periodic run reduced to its average period while it is read."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from armload_identification.excitation.fourier import Excitation
from armload_identification.recording.recording import PeriodAverage, Recording, RecordingSource
from armload_identification.recording.reduction.phase_advance import (
    SETTLING_S,
    PhaseAdvance,
    phases_of,
    shortest_period,
)
from armload_identification.recording.reduction.reduction import Reduction, WrongReduction
from armload_identification.recording.reduction.repeated_values import RepeatedValues
from armload_identification.recording.row_block import RowBlock

ON_GRID: Final = 0.05
"""Samples must be this close to a common grid, in grid steps, as those of every run that armload records are."""
_LEARNT_FROM: Final = 2**14
"""Rows with a phase from which the grid is determined."""


class PeriodAverager(Reduction):
    """Mean and scatter of every phase of a period, one period at a time (Welford's update).

    Args:
        path: Name of the run in messages.
        excitation: The excitation that it follows.
    """

    def __init__(self, path: Path, excitation: Excitation) -> None:
        super().__init__(_LEARNT_FROM)
        self._path, self._excitation = path, excitation

    def _used(self, rows: RowBlock) -> RowBlock:
        """The rows within the periods; none without a phase or an effort."""
        known = rows.phase_s is not None and rows.effort is not None
        return rows.rows(np.isfinite(np.asarray(rows.phase_s)) if known else slice(0, 0))

    def _learn(self, rows: RowBlock) -> None:
        """Determine the grid, K equidistant phases of a period, from the first rows."""
        phase = np.asarray(rows.phase_s)
        trajectory = shortest_period(phase, self._excitation.trajectory)
        self._period_s = trajectory.period_s
        self._phases = phases_of(phase, trajectory)
        self._step_s = self._period_s / self._phases
        self._offset = float(np.angle(np.mean(np.exp(2j * np.pi * phase / self._step_s)))) / (2.0 * np.pi)
        self._begin_at = int(np.round(float(phase[0]) / self._step_s - self._offset))
        columns = 2 * rows.n
        self._period = np.full((self._phases, columns), np.nan)
        self._number = 0
        self._count = np.zeros(self._phases, dtype=np.int64)
        self._mean = np.zeros((self._phases, columns))
        self._square = np.zeros((rows.n, rows.n))
        self._advance = PhaseAdvance(phase, rows.time_s, self._period_s)
        self._effort_name = "current_a" if rows.torque_nm is None else "torque_nm"

    def _reduce(self, rows: RowBlock) -> None:
        """Add rows, all of them with a phase, to the average."""
        phase = np.asarray(rows.phase_s)
        since_s = self._advance.add(phase, rows.time_s)
        place = phase / self._step_s - self._offset
        values = np.hstack([np.asarray(rows.effort), rows.position_rad])
        values[since_s < SETTLING_S] = np.nan
        index = np.round(place).astype(np.int64)
        if np.abs(place - index).max() >= ON_GRID:
            raise WrongReduction
        index -= self._begin_at
        number = index // self._phases
        for period in np.unique(number[index >= 0]):
            if period < self._number:
                raise WrongReduction
            while self._number < period:
                self._complete_period()
            chosen = number == period
            self._period[index[chosen] % self._phases] = values[chosen]

    def _reduced(self, source: RecordingSource, repeats: RepeatedValues | None) -> Recording:
        """The average period, of phases with samples, at the run's mean advance."""
        advance = self._advance
        if advance.held < 1:
            raise WrongReduction
        if self._number < advance.held:
            self._complete_period()
        advance.require_even(self._path)
        known = np.flatnonzero(self._count)
        freedom = int(np.maximum(self._count - 1, 0).sum())
        covariance = self._square / freedom if freedom > 1 else None
        phase_s = np.asarray((self._begin_at + known + self._offset) * self._step_s, dtype=np.float64)
        effort, position = np.hsplit(self._mean[known], 2)
        rows = RowBlock(advance.time_at(phase_s), position, **{self._effort_name: effort}, phase_s=phase_s)
        average = PeriodAverage(advance.periods, covariance, advance.interruptions)
        return Recording(**vars(rows), excitation=self._excitation, source=source, average=average, repeats=repeats)

    def _complete_period(self) -> None:
        """Add the completed period to the sums, and begin the next."""
        filled = np.isfinite(self._period[:, 0])
        # A complete period, which most are, is not copied.
        there = slice(None) if filled.all() else np.flatnonzero(filled)
        sample = self._period[there]
        self._count[there] += 1
        before = sample - self._mean[there]
        self._mean[there] += before / self._count[there, None]
        n = self._square.shape[0]
        self._square += before[:, :n].T @ (sample - self._mean[there])[:, :n]
        self._period[:] = np.nan
        self._number += 1
