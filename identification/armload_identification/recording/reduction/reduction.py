"""Interface of the reductions of a run while it is read, so that memory does not grow with its length.

A short run is kept unchanged. A long run that follows an excitation is reduced to its average period, any other to
means over 10 ms.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.reduction.repeated_values import RepeatCounter, RepeatedValues
from armload_identification.recording.row_block import RowBlock, joined


class WrongReduction(Exception):
    """A run cannot be reduced in this way, and must be read again with another reduction."""


class Reduction(ABC):
    """Reduces the usable rows of a run, block by block; how exactly, it learns from the first rows.

    Args:
        learnt_from: Number of these rows.
    """

    def __init__(self, learnt_from: int) -> None:
        self._learnt_from = learnt_from
        self._first: list[RowBlock] | None = []
        self._repeats: RepeatCounter | None = None

    def add(self, rows: RowBlock) -> None:
        """Add more rows.

        Raises:
            WrongReduction: the rows cannot be reduced in this way.
        """
        if rows.size and rows.effort is not None:
            self._repeats = self._repeats or RepeatCounter(rows.n)
            self._repeats.add(rows.effort, rows.position_rad)
        used = self._used(rows)
        if not used.size:
            return
        if self._first is None:
            self._reduce(used)
            return
        self._first.append(used)
        if sum(block.size for block in self._first) >= self._learnt_from:
            self._begin(self._first)

    def recording(self, source: RecordingSource) -> Recording:
        """The reduced run.

        Raises:
            WrongReduction: the run cannot be reduced in this way.
            RecordingError: the run cannot be used.
        """
        if self._first is not None:
            self._begin(self._first)
        return self._reduced(source, None if self._repeats is None else self._repeats.found)

    def _begin(self, first: list[RowBlock]) -> None:
        """Learn from the first rows, and reduce them."""
        if sum(block.size for block in first) < 2:
            raise WrongReduction
        rows, self._first = joined(first), None
        self._learn(rows)
        self._reduce(rows)

    def _used(self, rows: RowBlock) -> RowBlock:
        """The rows to be reduced; all of them are searched for repeated values."""
        return rows

    @abstractmethod
    def _learn(self, rows: RowBlock) -> None:
        """Determine how to reduce from the first rows, at least two."""

    @abstractmethod
    def _reduce(self, rows: RowBlock) -> None:
        """Reduce more rows."""

    @abstractmethod
    def _reduced(self, source: RecordingSource, repeats: RepeatedValues | None) -> Recording:
        """The reduced run."""
