"""What is kept of a run while it is read, so that memory does not grow with its length.

A short run is kept as it is. A long run that follows an excitation becomes the sums of its average period, any other
means over 10 ms.
"""

from __future__ import annotations

from typing import Protocol

from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.recording.row_block import RowBlock


class WrongReduction(Exception):
    """A run cannot be reduced in this way; it must be read again to be reduced in another."""


class Reduction(Protocol):
    """Takes the usable rows of a run one block after the other."""

    def add(self, rows: RowBlock) -> None:
        """Go on with more rows.

        Raises:
            WrongReduction: the rows do not allow this way.
        """

    def recording(self, source: RecordingSource) -> Recording:
        """What is left of the run.

        Raises:
            WrongReduction: the run as a whole does not allow this way.
            RecordingError: the run cannot be used in any way.
        """
