"""What a reader of one recording format is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.row_block import RowBlock


@dataclass
class ReadingAccount:
    """What a reader found in a file; complete when its last block was taken.

    Attributes:
        sha256: Hash of the file.
        rows_read: Rows found, good or bad.
        reasons: Rows that have no place in a block, by reason.
        truncated: The file ends in the middle of a record.
        joint_names: Names of the joints in the order of the columns; empty where the file does not name them.
    """

    sha256: str = ""
    rows_read: int = 0
    reasons: dict[str, int] = field(default_factory=dict)
    truncated: bool = False
    joint_names: tuple[str, ...] = ()

    def leave_out(self, rows: int, reason: str) -> None:
        """Count rows that are left out.

        Args:
            rows: How many.
            reason: Why.
        """
        if rows:
            self.reasons[reason] = self.reasons.get(reason, 0) + rows


class RecordingReader(Protocol):
    """Reads one file, as often as it is asked to, in blocks of a few thousand rows.

    Attributes:
        kind: Name of the format.
        attachments: Text of the file's attachments by name.
    """

    kind: str
    attachments: Mapping[str, str]

    def blocks(self, account: ReadingAccount) -> Iterator[RowBlock]:
        """Read the file from its beginning.

        Args:
            account: Is filled in on the way.

        Yields:
            The file's rows in its order, as they are: garbage is found elsewhere.

        Raises:
            RecordingError: the file cannot be read, is damaged or holds nothing of what was asked for.
        """


class ReaderFactory(Protocol):
    """Opens files of one format."""

    def __call__(self, path: Path, start: bytes, options: ReadingOptions) -> RecordingReader | None:
        """A reader, or None where it is not of this format.

        Args:
            path: The file or folder.
            start: Its first bytes; none of a folder.
            options: What is known of it beforehand.

        Raises:
            RecordingError: it is of this format, but cannot be read.
        """
