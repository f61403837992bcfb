"""Interface of the reductions of a run while it is read, so that memory does not grow with its length.

A short run is kept unchanged. A long run that follows an excitation is reduced to its average period, any other to
means over 10 ms.
"""

from __future__ import annotations

from typing import Protocol

from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.row_block import RowBlock


class WrongReduction(Exception):
    """A run cannot be reduced in this way, and must be read again with another reduction."""


class Reduction(Protocol):
    """Reduces the usable rows of a run, block by block."""

    def add(self, rows: RowBlock) -> None:
        """Add more rows.

        Raises:
            WrongReduction: the rows cannot be reduced in this way.
        """

    def recording(self, source: RecordingSource) -> Recording:
        """The reduced run.

        Raises:
            WrongReduction: the run cannot be reduced in this way.
            RecordingError: the run cannot be used.
        """
